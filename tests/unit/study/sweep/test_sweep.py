"""A sweep: its numbers against single runs and a closed form, points that fail, going on."""

import json
import signal

import attrs
import numpy as np
import pytest
import xarray
from support.plain import jit_is_on
from support.studies import LENGTH, START, spring

import dap3d_core as dap
from dap3d_core.cli.console import sweep_tables
from dap3d_core.result import ResultError, current_versions
from dap3d_core.study import Ensemble

TIMES = {"t_end": 0.5, "dt": 0.1}
VARY = {"bodies.block.mass": [0.5, 2.0], "forces.spring.k": "4:16:2"}
OUTPUTS = ["block.r.x", "block.r.x:min", "block.r.x:series", "energy.kinetic:mean",
           "block.rd.x:rms", "block.r.x:integral"]  # fmt: skip


def at(t, mass, k):
    """Where the block is: a harmonic motion about the rest length."""
    return LENGTH + (START - LENGTH) * np.cos(np.sqrt(k / mass) * t)


@pytest.fixture(scope="module")
def swept():
    """Two masses and two stiffnesses."""
    return dap.sweep(spring(), VARY, outputs=OUTPUTS, **TIMES)


@pytest.fixture
def one_by_one(monkeypatch):
    """Points come alone and in their order; what is returned counts them."""
    ran = []

    def run_here(ensemble, points, places, threads):
        for place in places:
            ran.append(int(place))
            yield np.array([place]), ensemble.run(points[[place]])

    monkeypatch.setattr("dap3d_core.study.sweep.sweep.run_here", run_here)
    return ran


class Enough(Exception):
    pass


def stop_after(count):
    """A progress callback that ends a sweep after some points."""

    def progress(done, total):
        if done >= count:
            raise Enough

    return progress


# ---------------------------------------------------------------------------- numbers


def test_numbers_are_those_of_single_runs_bit_for_bit(swept):
    for i, mass in enumerate(VARY["bodies.block.mass"]):
        for j, k in enumerate([4.0, 16.0]):
            result = dap.simulate(spring(mass, k), **TIMES)
            found = swept.isel({"bodies.block.mass": i, "forces.spring.k": j})
            x = result.r[:, 0, 0]
            assert (found["block.r.x:series"] == x).all()
            assert found["block.r.x"] == x[-1]
            assert found["block.r.x:min"] == x.min()
            mean = np.trapezoid(result.energy.kinetic, result.t) / TIMES["t_end"]
            assert found["energy.kinetic:mean"] == mean
            square = np.trapezoid(result.rd[:, 0, 0] ** 2, result.t) / TIMES["t_end"]
            assert found["block.rd.x:rms"] == np.sqrt(square)
            assert found["block.r.x:integral"] == np.trapezoid(x, result.t)


def test_the_data_set_says_what_it_is(swept):
    """Dimensions in the given order, units, what status means, all that makes it again."""
    assert swept["block.r.x"].dims == ("bodies.block.mass", "forces.spring.k")
    assert swept["block.r.x:series"].dims == ("bodies.block.mass", "forces.spring.k", "time")
    assert swept["bodies.block.mass"].attrs["units"] == "kg"
    assert swept["forces.spring.k"].attrs["units"] == "N/m"
    assert swept["block.r.x:integral"].attrs["units"] == "m s"
    assert swept["forces.spring.k"].values.tolist() == [4.0, 16.0]
    assert swept["block.r.x"].attrs == {"long_name": "position of block, x", "units": "m"}
    assert swept["time"].values == pytest.approx(np.arange(6) / 10)
    assert (swept["status"] == 1).all()
    assert swept["status"].attrs["flag_meanings"] == "open done stopped failed"
    assert (swept["note"] == "").all()
    about = swept.attrs
    assert (about["dap3d_sweep"], about["model"], about["design"]) == (1, "spring", "grid")
    assert "seed" not in about
    assert json.loads(about["varied"]) == [
        {"name": "bodies.block.mass", "spec": [0.5, 2.0]},
        {"name": "forces.spring.k", "spec": "4:16:2"},
    ]
    outputs = json.loads(about["outputs"])
    assert outputs[0] == {"name": "block.r.x", "label": "position of block, x", "unit": "m"}
    assert json.loads(about["versions"])["dap3d"]
    from dap3d_core.scene import parse

    assert parse(about["scene"]).simulation.t_end == 0.5


def test_samples_lie_along_points():
    found = dap.sweep(
        spring(), {"forces.spring.k": "4:16"},
        outputs={"x": "block.r.x", "twice": lambda result: 2.0 * result.r[-1, 0, 0]},
        sample=4, seed=3, **TIMES,
    )  # fmt: skip
    assert found["x"].dims == ("point",)
    assert "forces.spring.k" in found.coords
    k = found["forces.spring.k"].values
    assert found["x"].values == pytest.approx(at(0.5, 1.0, k), abs=1e-7)
    assert (found["twice"] == 2.0 * found["x"]).all()
    assert (found.attrs["design"], found.attrs["seed"]) == ("lhs", 3)


def test_a_scene_is_left_as_it_is():
    scene = spring()
    text = scene.to_toml()
    dap.sweep(scene, {"bodies.block.mass": [2.0]}, outputs="block.r.x", t_end=0.1)
    assert scene.to_toml() == text


# ---------------------------------------------------------------------------- files


def test_a_file_holds_the_same(swept, tmp_path):
    """The same data as returned, what is read, and what xarray reads by itself."""
    path = tmp_path / "a.nc"
    found = dap.sweep(spring(), VARY, outputs=OUTPUTS, output=path, **TIMES)
    assert found.identical(swept)
    assert dap.open_sweep(path).identical(swept)
    assert [file.name for file in tmp_path.iterdir()] == ["a.nc"]
    with xarray.open_dataset(path) as plain:
        assert plain.identical(swept)
    swept.to_netcdf(tmp_path / "b.nc")
    assert dap.open_sweep(tmp_path / "b.nc").equals(swept)


def test_samples_in_a_file(tmp_path):
    """Coordinates of samples stay coordinates, and notes, statuses and NaN come back."""
    vary = {"bodies.block.mass": [1.0, -1.0, -2.0]}
    options = dict(outputs="block.r.x", sample=6, **TIMES)
    memory = dap.sweep(spring(), vary, **options)
    found = dap.sweep(spring(), vary, output=tmp_path / "a.nc", **options)
    assert found.identical(memory)
    assert sorted(found["status"].values) == [1, 1, 3, 3, 3, 3]
    assert (np.isnan(found["block.r.x"]) == (found["status"] == 3)).all()


def test_names_that_no_file_takes(tmp_path):
    scene = spring()
    scene.add_body("a/b", mass=1.0, Jp=(1.0, 1.0, 1.0))
    vary, outputs = {"bodies.a/b.mass": [1.0]}, ["a/b.r.x", "block.r.x"]
    found = dap.sweep(scene, vary, outputs=outputs, t_end=0.1)
    assert found["status"].item() == 1
    with pytest.raises(dap.SceneError) as refused:
        dap.sweep(scene, vary, outputs=outputs, t_end=0.1, output=tmp_path / "x.nc")
    assert [m.key for m in refused.value.mistakes] == ["vary", "outputs"]
    assert "give it a label" in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_existing_files_are_left(tmp_path):
    path = tmp_path / "a.nc"
    path.write_text("mine")
    options = dict(outputs="block.r.x", t_end=0.1, output=path)
    with pytest.raises(ResultError, match="the file exists"):
        dap.sweep(spring(), {"forces.spring.k": [1.0]}, **options)
    assert path.read_text() == "mine"
    dap.sweep(spring(), {"forces.spring.k": [1.0]}, force=True, **options)
    assert dap.open_sweep(path)["status"].item() == 1


def test_results_and_sweeps_are_distinguished(tmp_path):
    dap.simulate(spring(), t_end=0.1, output=tmp_path / "run.nc")
    dap.sweep(spring(), {"forces.spring.k": [1.0]}, outputs="block.r.x", t_end=0.1,
              output=tmp_path / "sweep.nc")  # fmt: skip
    with pytest.raises(ResultError, match=r"result of one run, not of a sweep; dap\.open reads it"):
        dap.open_sweep(tmp_path / "run.nc")
    with pytest.raises(ResultError, match=r"points of a sweep.*dap\.open_sweep reads it"):
        dap.open(tmp_path / "sweep.nc")
    xarray.Dataset({"a": 1.0}).to_netcdf(tmp_path / "other.nc")
    with pytest.raises(ResultError, match="no sweep of dap3d"):
        dap.open_sweep(tmp_path / "other.nc")
    newer = dap.open_sweep(tmp_path / "sweep.nc").assign_attrs(dap3d_sweep=np.int32(99))
    newer.to_netcdf(tmp_path / "newer.nc")
    with pytest.raises(ResultError, match="install a newer dap3d"):
        dap.open_sweep(tmp_path / "newer.nc")
    bare = dap.open_sweep(tmp_path / "sweep.nc").drop_vars("status")
    bare.to_netcdf(tmp_path / "bare.nc")
    with pytest.raises(ResultError, match="it has no status"):
        dap.open_sweep(tmp_path / "bare.nc")


def test_a_large_file_is_read_lazily(swept, tmp_path, monkeypatch):
    """Lazily, with the same numbers; so are its extremes, block by block."""
    path = tmp_path / "a.nc"
    dap.sweep(spring(), VARY, outputs=OUTPUTS, output=path, **TIMES)
    expected = sweep_tables.sweep_data(swept)
    monkeypatch.setattr("dap3d_core.study.sweep.dataset.LARGE", 0)
    monkeypatch.setattr(sweep_tables, "LARGE", 1)
    with dap.open_sweep(path) as found:
        assert found["block.r.x"].variable._in_memory is False
        assert sweep_tables.sweep_data(found) == expected
        assert found.load().identical(swept)


def test_a_file_that_appears_meanwhile_is_left(tmp_path, one_by_one):
    """The points stay in the part, from where a sweep with force is finished."""
    path = tmp_path / "a.nc"
    options = dict(outputs="block.r.x", output=path, **TIMES)
    with pytest.raises(ResultError, match="cannot write") as ended:
        dap.sweep(spring(), VARY, progress=lambda done, total: path.write_text("mine"), **options)
    assert (ended.value.result["status"] == 1).all()
    assert path.read_text() == "mine"
    found = dap.sweep(spring(), VARY, resume=True, force=True, **options)
    assert (found["status"] == 1).all()
    assert one_by_one == [0, 1, 2, 3]


# ---------------------------------------------------------------------------- going on


def test_a_sweep_goes_on_where_it_was_ended(swept, tmp_path, one_by_one):
    """Each point is run once, notes of those before survive, and the file is that of one sweep."""
    path = tmp_path / "a.nc"
    options = dict(outputs=OUTPUTS, output=path, **TIMES)
    with pytest.raises(Enough) as ended:
        dap.sweep(spring(), VARY, progress=stop_after(1), **options)
    assert [file.name for file in tmp_path.iterdir()] == ["a.nc.part"]
    so_far = ended.value.result
    assert so_far["status"].values.ravel().tolist() == [1, 0, 0, 0]
    assert np.isnan(so_far["block.r.x:series"].values.reshape(4, -1)[1:]).all()
    for _ in range(2):  # once more, from a part that was gone on with
        with pytest.raises(Enough):
            dap.sweep(spring(), VARY, progress=stop_after(len(one_by_one) + 1), resume=True,
                      **options)  # fmt: skip
    counted = []
    found = dap.sweep(spring(), VARY, resume=True, **options,
                      progress=lambda done, total: counted.append((done, total)))  # fmt: skip
    assert one_by_one == [0, 1, 2, 3]
    assert counted == [(3, 4), (4, 4)]
    assert found.identical(swept)
    assert [file.name for file in tmp_path.iterdir()] == ["a.nc"]


def test_notes_survive(tmp_path, one_by_one):
    vary = {"bodies.block.mass": [-1.0, 1.0, -2.0]}
    options = dict(outputs="block.r.x", output=tmp_path / "a.nc", **TIMES)
    with pytest.raises(Enough):
        dap.sweep(spring(), vary, progress=stop_after(1), **options)
    found = dap.sweep(spring(), vary, resume=True, **options)
    assert found["status"].values.tolist() == [3, 1, 3]
    assert ["-1" in note or "greater than 0" in note for note in found["note"].values] == [
        True, False, True]  # fmt: skip


def test_a_part_may_be_read_while_it_grows(tmp_path, one_by_one, monkeypatch):
    monkeypatch.setattr("dap3d_core.study.sweep.file.EVERY", 0.0)
    seen = []

    def look(done, total):
        part = dap.open_sweep(tmp_path / "a.nc.part")
        seen.append(int((part["status"] == 1).sum()))

    dap.sweep(spring(), VARY, outputs="block.r.x", output=tmp_path / "a.nc", progress=look, **TIMES)
    assert seen == [0, 1, 2, 3, 4]


def test_what_is_in_memory_is_kept_when_it_is_ended_and_nothing_before_the_first_point(
    tmp_path, one_by_one
):
    def interrupt(done, total):
        if done == 2:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt) as ended:
        dap.sweep(spring(), VARY, outputs="block.r.x", progress=interrupt, **TIMES)
    assert ended.value.result["status"].values.ravel().tolist() == [1, 1, 0, 0]
    with pytest.raises(Enough) as ended:
        dap.sweep(spring(), VARY, outputs="block.r.x", progress=stop_after(0),
                  output=tmp_path / "a.nc", **TIMES)  # fmt: skip
    assert not hasattr(ended.value, "result")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def part(tmp_path, one_by_one):
    """Path of a sweep of samples that was ended after two points, and its arguments."""
    arguments = dict(outputs=["block.r.x"], sample=3, output=tmp_path / "a.nc", **TIMES)
    with pytest.raises(Enough):
        dap.sweep(spring(), {"forces.spring.k": "4:16"}, progress=stop_after(2), **arguments)
    return arguments


@pytest.mark.parametrize(
    ("changes", "patched", "words"),
    [
        ({"t_end": 0.25}, {}, "another scene or other settings"),
        ({"outputs": ["block.r.y"]}, {}, "other outputs"),
        ({"seed": 1}, {}, "another seed"),
        ({"vary": {"forces.spring.k": "4:8"}}, {}, "other numbers that vary, or other values"),
        (
            {},
            {"current_versions": current_versions() | {"numpy": "1.0"}},
            "other versions of dap3d",
        ),
        ({}, {"digests_of": {"force ptp": "x"}}, "the file of a type has changed since"),
    ],
)
def test_another_sweep_does_not_go_on(part, monkeypatch, changes, patched, words):
    """Types are known by a digest of the file they stand in."""
    for name, found in patched.items():
        monkeypatch.setattr(f"dap3d_core.study.sweep.dataset.{name}", lambda *_, found=found: found)
    arguments = {"vary": {"forces.spring.k": "4:16"}} | part | changes
    file = arguments["output"].with_name("a.nc.part")
    before = file.read_bytes()
    with pytest.raises(ResultError, match=words):
        dap.sweep(spring(), resume=True, **arguments)
    assert file.read_bytes() == before


def test_a_damaged_part_is_refused_and_left(part):
    """Cut off at some lengths: what its library makes of it is one sentence."""
    file = part["output"].with_name("a.nc.part")
    whole = file.read_bytes()
    for length in (9, len(whole) // 4, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:length])
        with pytest.raises(ResultError, match="cannot resume"):
            dap.sweep(spring(), {"forces.spring.k": "4:16"}, resume=True, **part)
        assert file.read_bytes() == whole[:length]


def test_a_part_is_not_lost_by_beginning_anew(part, one_by_one):
    """Without resume it is refused; with force it makes way, where it is one."""
    vary, file = {"forces.spring.k": "4:16"}, part["output"].with_name("a.nc.part")
    with pytest.raises(ResultError, match="resume goes on with it, force begins anew"):
        dap.sweep(spring(), vary, **part)
    assert file.exists()
    one_by_one.clear()
    dap.sweep(spring(), vary, force=True, **part)
    assert one_by_one == [0, 1, 2]
    assert not file.exists()
    for content in (b"mine", b""):
        file.write_bytes(content)
        for options, verb in (({"force": True}, "overwrite"), ({"resume": True}, "resume")):
            arguments = part | options | {"output": part["output"].with_name("a.nc")}
            arguments["output"].unlink(missing_ok=True)
            with pytest.raises(ResultError, match=f"cannot {verb}: .*move it away"):
                dap.sweep(spring(), vary, **arguments)
            assert file.read_bytes() == content


@pytest.mark.parametrize("options", [{}, {"force": True}, {"resume": True}])
def test_a_sweep_that_goes_on_keeps_its_part(tmp_path, one_by_one, swept, options):
    """Another one with its output is refused, whatever it asks for, and takes nothing away."""
    path = tmp_path / "a.nc"
    asked = dict(outputs=OUTPUTS, output=path, **TIMES)
    refused = []

    def progress(done, total):
        if done == 2:
            with pytest.raises(ResultError, match="another sweep is writing it now") as error:
                dap.sweep(spring(), VARY, **asked, **options)
            refused.append(error)

    found = dap.sweep(spring(), VARY, progress=progress, **asked)
    assert len(refused) == 1
    assert found.identical(swept)
    assert [file.name for file in tmp_path.iterdir()] == ["a.nc"]


def test_there_must_be_something_to_go_on_with(tmp_path):
    options = dict(outputs="block.r.x", resume=True, **TIMES)
    with pytest.raises(ResultError, match="without resume the sweep begins anew"):
        dap.sweep(spring(), VARY, output=tmp_path / "a.nc", **options)
    with pytest.raises(dap.SceneError, match="give output"):
        dap.sweep(spring(), VARY, **options)
    assert list(tmp_path.iterdir()) == []


# ---------------------------------------------------------------------------- mistakes


@pytest.mark.parametrize(
    ("changes", "keys", "words"),
    [
        (
            {"vary": {"bodies.blok.mass": "x"}, "outputs": "block.r.x:mx", "t_end": -1.0},
            ["t_end", "vary bodies.blok.mass", "outputs"],
            "should be at least 0",
        ),
        (
            {"vary": {"bodies.blok.mass": [1.0], "none": [1.0]}, "outputs": ["blok.r.x", "t.x"]},
            ["vary", "vary", "outputs", "outputs"],
            "did you mean 'bodies.block.mass'",
        ),
        ({"outputs": {"bodies.block.mass": "block.r.x"}}, ["outputs"], "take another label"),
        ({"outputs": ["block.r", "block.r.x"]}, ["outputs"], "named once only"),
        ({"threads": 2, "client": object()}, ["threads"], "the workers of a client have their own"),
        ({"vary": {"simulation.t_end": [1.0, 2.0]}, "outputs": "block.r.x:series"}, ["outputs"],
         "a series has the same length"),
        ({"integrator": "rk4"}, ["step"], "rk4 does not choose its step"),
        ({"rtol": 0.0, "integrator": "cvode"}, ["integrator", "rtol"], "should be one of"),
    ],
)  # fmt: skip
def test_mistakes_are_reported_together(changes, keys, words):
    arguments = {"vary": {"bodies.block.mass": [1.0]}, "outputs": "block.r.x"} | TIMES | changes
    with pytest.raises(dap.SceneError) as refused:
        dap.sweep(spring(), **arguments)
    assert [m.key for m in refused.value.mistakes] == keys
    assert words in str(refused.value)


@pytest.mark.slow
def test_a_sweep_without_room_is_refused(monkeypatch, tmp_path):
    """In memory and on the disk, with figures; force begins it all the same."""
    monkeypatch.setattr("dap3d_core.simulation.output.free_space._free_memory", lambda: 2**20)
    monkeypatch.setattr("dap3d_core.simulation.output.free_space._free_disk", lambda folder: 2**20)
    vary = {"forces.spring.k": "1:2:20001"}
    options = dict(outputs="block.r.x:series", t_end=0.1, dt=0.1 / 1000)
    with pytest.raises(dap.SceneError, match=r"20,001 points .* in memory"):
        dap.sweep(spring(), vary, **options)
    with pytest.raises(dap.SceneError, match=r"20,001 points .* on the disk"):
        dap.sweep(spring(), vary, output=tmp_path / "a.nc", **options)
    with pytest.raises(Enough):
        dap.sweep(spring(), vary, force=True, progress=stop_after(0), **options)


def test_whole_numbers_stay_whole(monkeypatch):
    """Of a field that is one (of teeth, say): halves and ranges that are sampled are refused."""
    scene = spring()

    def with_whole(study, announce=None):
        ensemble = Ensemble(study, announce)
        ensemble.parameters = tuple(attrs.evolve(p, whole=True) for p in ensemble.parameters)
        return ensemble

    monkeypatch.setattr("dap3d_core.study.sweep.sweep.Ensemble", with_whole)
    for spec, sample in (("1:2:3", None), ("1:4", 2)):
        with pytest.raises(dap.SceneError, match="this is a whole number; list whole values"):
            dap.sweep(scene, {"forces.spring.k": spec}, outputs="block.r.x", sample=sample, **TIMES)
    found = dap.sweep(scene, {"forces.spring.k": "1:3:3"}, outputs="block.r.x", t_end=0.1)
    assert (found["status"] == 1).all()


@pytest.mark.slow
@pytest.mark.skipif(not jit_is_on(), reason="derivatives are of compiled code")
def test_derivatives_by_what_varies(swept, tmp_path):
    """Outputs have the bits that they have without; derivatives those of the closed form, to 1e-7.
    Of x = l + a cos(sqrt(k/m) t): dx/dk = -a t sin(w t) / (2 sqrt(k m)), dx/dm = -k/m dx/dk."""
    with_slopes = dap.sweep(
        spring(), VARY, outputs=OUTPUTS, gradients=True, output=tmp_path / "x.nc", **TIMES
    )
    for name in (*OUTPUTS, "status", "note"):
        assert with_slopes[name].identical(swept[name])
    slopes = with_slopes["d block.r.x:series"]
    assert slopes.dims == (*VARY, "time", "parameter")
    assert slopes.parameter.values.tolist() == list(VARY)
    m, k, t = swept["bodies.block.mass"], swept["forces.spring.k"], with_slopes["time"]
    by_k = -(START - LENGTH) * t * np.sin(np.sqrt(k / m) * t) / (2.0 * np.sqrt(k * m))
    for name, expected in (("forces.spring.k", by_k), ("bodies.block.mass", -k / m * by_k)):
        found = slopes.sel(parameter=name).transpose(*expected.dims)
        np.testing.assert_allclose(found, expected, atol=1e-7)
    np.testing.assert_array_equal(with_slopes["d block.r.x"], slopes[:, :, -1])
    table = sweep_tables.sweep_data(with_slopes)["outputs"]
    assert [one["name"] for one in table] == [*OUTPUTS, *(f"d {name}" for name in OUTPUTS)]
    assert table[-1]["at_max"]["parameter"] in VARY
    again = dap.open_sweep(tmp_path / "x.nc")
    assert again.identical(with_slopes)


@pytest.mark.skipif(not jit_is_on(), reason="derivatives are of compiled code")
def test_what_has_no_derivative_is_refused_before_any_point():
    with pytest.raises(dap.SceneError, match=r"simulation\.rtol.*how a run is computed"):
        dap.sweep(
            spring(), {"simulation.rtol": [1e-6]}, outputs="block.r.x", gradients=True, **TIMES
        )
