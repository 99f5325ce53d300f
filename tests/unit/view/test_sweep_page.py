"""The page of a sweep holds the motions of its points as a run of each gives them."""

import base64
import json

import numpy as np
import pytest
from support.plain import jit_is_on
from support.studies import LENGTH, START, spring

import dap3d_core as dap
from dap3d_core.view import sweep_page

#: Rest length and start of the spring below, m.
MASS, K = "bodies.block.mass", "forces.spring.k"
TIMES = {"t_end": 0.2, "dt": 0.05}

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="runs many points; compiled elsewhere")


def swept(vary, outputs=("block.r.x:min",), **options):
    return dap.sweep(spring(), vary, outputs=list(outputs), **TIMES, **options)


@pytest.fixture(scope="module")
def grid():
    return swept({MASS: [0.5, 2.0], K: "4:16:3"}, ["block.r.x:min", "block.r.x:series"])


@pytest.fixture(scope="module")
def page(grid):
    return dap.view(grid)


def data_of(page, k):
    """The data of a point: what all share, and its own."""
    return {**page.data, **page.data["sweep"]["points"][k]["data"]}


def poses(data):
    flat = np.frombuffer(base64.b64decode(data["poses"]), dtype="<f4")
    return flat.reshape(data["instants"], -1, 7)


def test_motions_are_those_of_the_points(grid, page):
    """A harmonic motion about the rest length."""
    points = page.data["sweep"]["points"]
    assert [tuple(p["values"]) for p in points] == [(m, k) for m in (0.5, 2.0) for k in (4, 10, 16)]
    for place, point in enumerate(points):
        data = data_of(page, place)
        t = np.frombuffer(base64.b64decode(data["t"]), dtype="<f8")
        np.testing.assert_allclose(t, np.linspace(0.0, 0.2, 5), atol=1e-15)
        mass, k = point["values"]
        expected = LENGTH + (START - LENGTH) * np.cos(np.sqrt(k / mass) * t)
        np.testing.assert_allclose(poses(data)[:, 0, 0], expected, atol=1e-6)
        assert f"mass = {mass}" in data["about"]["scene"]


def test_numbers_and_outputs_stand_beside_the_motion(grid, page):
    about = page.data["sweep"]
    assert [(s["name"], s["unit"], s["values"]) for s in about["sliders"]] == [
        (MASS, "kg", [0.5, 2.0]),
        (K, "N/m", [4.0, 10.0, 16.0]),
    ]
    assert [one["name"] for one in about["outputs"]] == ["block.r.x:min"]  # series are curves
    found = [point["outputs"][0] for point in about["points"]]
    assert found == grid["block.r.x:min"].values.ravel().tolist()
    assert page.data["asked"] == ["block.r.x"]
    assert dap.view(grid.isel({K: [0]}), "energy.total").data["asked"] == ["energy.total"]
    assert about["notes"] == []


def test_what_points_share_is_there_once(page):
    for point in page.data["sweep"]["points"]:
        assert not {"stage", "scales", "bodies", "points", "joints"} & set(point["data"])
    json.dumps(page.data, allow_nan=False)


def test_one_stage_holds_all_motions(page):
    stage = page.data["stage"]
    low = np.array(stage["center"]) - 0.5 * np.array(stage["extent"])
    high = low + stage["extent"]
    for k in range(len(page.data["sweep"]["points"])):
        r = poses(data_of(page, k))[:, 0, :3]
        assert np.all(r >= low - 1e-6)
        assert np.all(r <= high + 1e-6)


def test_reports_at_the_end_alone_become_a_motion():
    data = swept({MASS: [1.0, 2.0]}, ["block.r.x"])
    assert dap.view(data).instants > 4


def test_of_many_points_some_are_shown_and_the_page_says_so(monkeypatch):
    monkeypatch.setattr(sweep_page, "MOST_POINTS", 6)
    data = swept({MASS: "1~0.1"}, sample=21)
    about = dap.view(data).data["sweep"]
    (slider,) = about["sliders"]
    assert slider["values"] == [0, 4, 8, 12, 16, 20]
    assert slider["of"] == 21
    assert [p["values"][0] for p in about["points"]] == data[MASS].values[::4].tolist()
    assert about["notes"] == ["6 of 21 points of the sweep are on this page, evenly chosen"]
    monkeypatch.setattr(sweep_page, "MOST_CHARACTERS", 10)
    assert len(dap.view(data).data["sweep"]["points"]) == 2


def test_points_of_a_grid_are_chosen_along_each_axis(grid):
    few = sweep_page.SweepPoints.of(grid, 4)
    assert few.shape == (2, 2)
    assert few.data[K].values.tolist() == [4.0, 16.0]
    assert few.total == 6
    cut = sweep_page.SweepPoints.of(grid.isel({MASS: 1}), 50)
    assert cut.axes == [K]
    assert len(dap.view(grid.isel({MASS: 1})).data["sweep"]["points"]) == 3


def test_points_that_fail_have_no_motion_and_say_why():
    """A negative mass cannot be run; the first page is that of a point that can."""
    data = swept({MASS: [-1.0, 1.0]})
    page = dap.view(data)
    bad, good = page.data["sweep"]["points"]
    assert (bad["status"], bad["data"], bad["outputs"]) == ("failed", None, [None])
    assert "mass" in bad["note"]
    assert (good["status"], good["note"]) == ("done", "")
    assert poses(data_of(page, 1)).shape == (page.instants, 1, 7)
    with pytest.raises(ValueError, match=r"none of 1 points runs: .*mass"):
        dap.view(data.isel({MASS: [0]}))


def test_progress_is_told(grid):
    told = []
    dap.view(grid, progress=lambda *counts: told.append(counts))
    assert list(dict.fromkeys(told)) == [(k, 6) for k in range(7)]

    def enough(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):  # from within the first run
        dap.view(grid, progress=enough)


def test_what_cannot_be_shown_is_refused(grid):
    with pytest.raises(dap.SceneError, match="nothing"):
        dap.view(grid, model="nothing")
    with pytest.raises(KeyError, match=r"block\.r"):
        dap.view(grid, "block.rr")
    with pytest.raises(ValueError, match="is of no sweep"):
        dap.view(grid.drop_attrs())
    with pytest.raises(ValueError, match="has no points"):
        dap.view(grid.isel({MASS: slice(0, 0)}))
    with pytest.raises(ValueError, match=f"no values of {K}"):
        dap.view(grid.isel({K: 0}).drop_vars(K))
    with pytest.raises(ValueError, match="fps"):
        dap.view(grid, fps=0.0)


def test_types_of_the_models_own_need_leave():
    """As elsewhere: the model is named and its code is allowed."""
    data = dap.sweep("ball1", {"bodies.ball.mass": [1.0, 2.0]}, outputs="ball.r.z", t_end=0.05,
                     dt=0.01, allow_code=True)  # fmt: skip
    with pytest.raises(dap.SceneError, match="--model MODEL --allow-code"):
        dap.view(data)
    with pytest.raises(dap.SceneError, match="is not run unless it is allowed"):
        dap.view(data, model="ball1")
    assert len(dap.view(data, model="ball1", allow_code=True).data["sweep"]["points"]) == 2
