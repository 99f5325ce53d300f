"""Designs of studies: grids, samples, and what is neither."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

import dap3d_core as dap
from dap3d_core.study.design import DESIGNS, design_of


@pytest.mark.parametrize(
    ("spec", "values"),
    [
        ("1:5:9", np.arange(1.0, 5.25, 0.5)),
        ("5:1:3", [5.0, 3.0, 1.0]),
        ("-1 : 1 : 2", [-1.0, 1.0]),
        ("1:100:5:log", [1.0, math.sqrt(10.0), 10.0, 10.0 * math.sqrt(10.0), 100.0]),
        ("100:1:3:log", [100.0, 10.0, 1.0]),
        ("10,50, 100", [10.0, 50.0, 100.0]),
        ("3e2", [300.0]),
        ([2, 1.5], [2.0, 1.5]),
        (np.float32(0.5), [0.5]),
        (np.arange(3), [0.0, 1.0, 2.0]),
        ((7,), [7.0]),
    ],
)
def test_the_axis_of_a_grid(spec, values):
    """Its ends are hit exactly."""
    found = design_of({"x": spec})
    (axis,) = found.axes
    assert axis == pytest.approx(np.asarray(values), rel=1e-15)
    assert (axis[0], axis[-1]) == (values[0], values[-1])
    assert (found.name, found.count, found.seed, found.shape) == ("grid", None, None, axis.shape)


def test_a_grid_has_all_combinations_the_last_number_fastest():
    found = design_of(["a=1,2", "b=1:3:3", "c=9"])
    assert found.shape == (2, 3, 1)
    assert found.dimensions == ("a", "b", "c")
    assert found.size == 6
    expected = [(a, b, 9.0) for a in (1.0, 2.0) for b in (1.0, 2.0, 3.0)]
    assert found.points().tolist() == [list(point) for point in expected]


@pytest.mark.parametrize("design", DESIGNS)
def test_samples_fill_their_ranges_and_repeat(design):
    """Inside, the same for a seed, others for another; a share of each tenth, where strata are
    those of the design."""
    vary = {"a": "2:4", "b": "1:100:log", "c": "3~0.5", "d": "10,20"}
    found = design_of(vary, 64, design, 1)
    points = found.points()
    assert points.shape == (64, 4)
    assert found.dimensions == ("point",)
    assert (points == design_of(vary, 64, design, 1).points()).all()
    assert (points != design_of(vary, 64, design, 2).points()).any()
    assert ((points[:, 0] > 2.0) & (points[:, 0] < 4.0)).all()
    assert ((points[:, 1] > 1.0) & (points[:, 1] < 100.0)).all()
    assert set(points[:, 3]) == {10.0, 20.0}
    shares = [
        (points[:, 0] - 2.0) / 2.0,
        np.log10(points[:, 1]) / 2.0,
        stats.norm(3.0, 0.5).cdf(points[:, 2]),
    ]
    for share in shares:
        counts = np.histogram(share, bins=8, range=(0.0, 1.0))[0]
        if design in ("lhs", "sobol"):  # 64 points, 8 strata: 8 in each
            assert counts.tolist() == [8] * 8
        else:
            assert counts.min() > 0


def test_a_latin_hypercube_takes_each_of_a_list_as_often():
    points = design_of({"a": "1,2,3"}, 12).points()
    assert [int((points == value).sum()) for value in (1, 2, 3)] == [4, 4, 4]


def test_a_share_at_the_end_is_finite():
    """Sobol' sequences reach 0, where the normal distribution does not end."""
    (varied,) = design_of({"a": "0~1"}, 2).varied
    assert np.isfinite(varied.quantiles(np.array([0.0, 1.0]))).all()
    (listed,) = design_of({"a": "1,2"}, 2).varied
    assert listed.quantiles(np.array([0.0, 1.0])).tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("vary", "options", "words"),
    [
        ({}, {}, "nothing varies"),
        (3, {}, "what varies is"),
        ("a", {}, "what varies is NAME=FORM"),
        (["=3"], {}, "what varies is NAME=FORM"),
        ([3], {}, "what varies is NAME=FORM"),
        ({"a": ""}, {}, "no values"),
        ({"a": "x"}, {}, "no finite number"),
        ({"a": "1,x,3"}, {}, 'vary a = "x"'),
        ({"a": "1,,3"}, {}, "no finite number"),
        ({"a": "1_000"}, {}, "no finite number"),
        ({"a": [1.0, np.inf]}, {}, "no finite number"),
        ({"a": "1:1e200:3"}, {}, "no finite number of at most 1e+100"),
        ({"a": "1:b:3"}, {}, "'b' is no finite number"),
        ({"a": []}, {}, "no points"),
        ({"a": [[1.0], [2.0, 3.0]]}, {}, "should be numbers in a list"),
        ({"a": None}, {}, "should be numbers in a list"),
        ({"a": {"b": 1}}, {}, "should be numbers in a list"),
        ({"a": 1j}, {}, "should be numbers in a list"),
        ({"a": "10,10"}, {}, "10 is in the list twice"),
        ({"a": [0.0, -0.0]}, {}, "0 is in the list twice"),
        ({"a": "1:2:3:4"}, {}, "should be one of 1:5:9"),
        ({"a": "1:5"}, {}, "add how many, 1:5:9, or sample"),
        ({"a": "1:5:log"}, {}, "add how many, 1:5:9:log"),
        ({"a": "1:5:0"}, {}, "no points"),
        ({"a": "1:5:1"}, {}, "does not reach"),
        ({"a": "1:5:2.5"}, {}, "'2.5' is no whole number"),
        ({"a": "3:3:2"}, {}, "begins where it ends"),
        ({"a": "0:5:2:log"}, {}, "a logarithm is of positive numbers"),
        ({"a": "1:5:1000000000000"}, {}, "1e+12 points"),
        ({"a": "0:1:1000000", "b": "0:1:1000000"}, {}, "1,000,000 x 1,000,000 = 1e+12 points"),
        (["a=1,2", "a=3"], {}, "varied only once"),
        ({"a": "3~1"}, {}, "a normal distribution is sampled"),
        ({"a": "1:5:3"}, {"sample": 9}, "leave the count out: 1:5"),
        ({"a": "1:5:3:log"}, {"sample": 9}, "leave the count out: 1:5:log"),
        ({"a": "3~0"}, {"sample": 9}, "greater than 0"),
        ({"a": "3~1~1"}, {"sample": 9}, "mean~standard deviation"),
        ({"a": "1:2"}, {"sample": 0}, "from 1 to 1e+08"),
        ({"a": "1:2"}, {"sample": 2.5}, "a whole number"),
        ({"a": "1:2"}, {"sample": True}, "a whole number"),
        ({"a": "1:2"}, {"sample": 10**12}, "from 1 to 1e+08"),
        ({"a": "1:2"}, {"sample": 9, "design": "lsh"}, "did you mean 'lhs'"),
        ({"a": "1:2"}, {"sample": 9, "design": "grid"}, "leave sample and design out"),
        ({"a": "1:2"}, {"sample": 9, "design": None}, "drawn by one of lhs, random"),
        ({"a": "1:2"}, {"sample": 9, "seed": -1}, "the seed is a whole number"),
        ({f"a{k}": 1.0 for k in range(1001)}, {}, "1001 numbers vary; at most 1000"),
    ],
)
def test_invalid_designs(vary, options, words):
    with pytest.raises(dap.SceneError) as refused:
        design_of(vary, **options)
    assert words in str(refused.value)


def test_all_mistakes_are_reported_at_once():
    with pytest.raises(dap.SceneError) as refused:
        design_of({"a": "x", "b": "1:5:3", "c": "2~0"}, 0, "lsh", -1)
    keys = [mistake.key for mistake in refused.value.mistakes]
    assert keys == ["sample", "design", "seed", "vary a", "vary b", "vary c"]


@given(st.text("012:,~.-elog nax_", max_size=9), st.sampled_from([None, 3]))
def test_any_text_is_a_design_of_finite_points_or_a_mistake(text, sample):
    try:
        points = design_of({"a": text}, sample).points()
    except dap.SceneError:
        return
    assert np.isfinite(points).all()
