"""Result files that somebody made by hand."""

import json
import shutil

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.cli import main
from dap3d_core.result import ResultError
from dap3d_core.result.file.validate import ALWAYS, check_shapes

netCDF4 = pytest.importorskip("netCDF4")


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A result in a file."""
    scene = dap.Scene(name="fall")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_body("ball", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(1.0, 0.0, 0.0))
    scene.add_point("top", "stone", (0.0, 0.0, 0.1))
    scene.add_force("weight", "gravity")
    path = tmp_path_factory.mktemp("good") / "good.nc"
    dap.simulate(scene, t_end=0.02, dt=0.01, integrator="rk4", step=0.01).save(path)
    return path


@pytest.fixture
def changed(good, tmp_path):
    """The result with something changed in its file."""

    def call(change):
        path = tmp_path / "changed.nc"
        shutil.copy(good, path)
        with netCDF4.Dataset(path, "a") as dataset:
            change(dataset)
        return path

    return call


def test_a_small_file_that_claims_1e12_numbers(good, tmp_path):
    """Chunks that were never written take no room in a file, and 8 TB in memory."""
    path = tmp_path / "bomb.nc"
    with netCDF4.Dataset(good) as old, netCDF4.Dataset(path, "w") as new:
        for name in old.ncattrs():
            value = old.getncattr(name)
            text = isinstance(value, str)
            (new.setncattr_string if text else new.setncattr)(name, value)
        for name, dimension in old.dimensions.items():
            new.createDimension(name, 10**11 if name == "time" else len(dimension))
        for name, variable in old.variables.items():
            options = {} if variable.dtype is str else {"fill_value": 0}
            if "time" in variable.dimensions:
                options["chunksizes"] = (1000, *variable.shape[1:])
            made = new.createVariable(name, variable.dtype, variable.dimensions, **options)
            if "time" not in variable.dimensions:
                made[:] = variable[:]
    assert path.stat().st_size < 10**6
    with pytest.raises(ResultError, match=r"claims .* GiB of numbers"):
        dap.open(path)


def test_claims_are_judged_by_the_size_of_the_file(tmp_path):
    file = tmp_path / "x.nc"
    check_shapes(file, [(ALWAYS // 8,)], 1000)
    check_shapes(file, [(10**9, 13)], 8 * 13 * 10**9)  # as dap3d writes it
    check_shapes(file, [(10**9, 13)], 13 * 10**9)  # pressed together
    for shapes in ([(ALWAYS // 8,), (1,)], [(10**12,)], [(10**6, 10**6, 10**6)]):
        with pytest.raises(ResultError, match="claims"):
            check_shapes(file, shapes, 10**5)


#: Attribute -> what it is not.
WRONG = [
    ("notes", 5), ("notes", {"a": 1}), ("notes", [1]), ("settings", [1]),
    ("settings", {"rtol": "x"}), ("settings", {"rank": "x"}), ("settings", {"a": [[[[1]]]]}),
    ("settings", {"dt": 10**400}), ("settings", {"length": 0.0}),
    ("statistics", {"steps": "x"}), ("statistics", {"evil": 1}),
    ("statistics", {"steps": float("inf")}), ("versions", {"a": 1}), ("versions", []),
    ("events", {}), ("events", [1]), ("events", [{"name": 1, "t": 0, "direction": 1}]),
    ("events", [{"name": "x", "t": 0, "direction": 1, "kind": "__import__('os')"}]),
    ("events", [{"name": "x", "t": 0, "direction": 1, "kind": "stop", "u": ["x"]}]),
    ("events", [{"name": "x", "t": 0, "direction": 1, "kind": "stop", "more": 1}]),
]  # fmt: skip


NO_JSON = [("notes", "[" * 100_000), ("settings", ""), ("statistics", "{"), ("versions", "nan"),
           ("events", '{"a": 1' + "0" * 5000 + "}")]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text"), [*((name, json.dumps(value)) for name, value in WRONG), *NO_JSON]
)
def test_attributes_of_another_form_and_no_json(changed, name, text):
    path = changed(lambda d: d.setncattr_string(name, text))
    with pytest.raises(ResultError, match="damaged"):
        dap.open(path)


#: Texts of a scene; none of them is one, or not of this result.
SCENES = ["[[[[", "a = " + "[" * 100_000, "a." * 100_000 + "a = 1",
          "[scene]\nname = 0x" + "f" * 10_000, "[scene]\nname = " + "1" * 10_000,
          "forces = [1, 2]\nbodies = 5\npoints = 'a'\nshapes = [1]\nanimation = 3\n",
          "[animation]\nlimits = ['a', {b = 1}]\npoints = 5\n[forces]\nx = 5\n"]  # fmt: skip


@pytest.mark.parametrize("text", SCENES)
def test_the_scene_in_a_result(changed, tmp_path, monkeypatch, capfd, text):
    """Read when a result is shown: as carefully as a scene file."""
    path = changed(lambda d: d.setncattr_string("scene", text))
    monkeypatch.chdir(tmp_path)
    for words in (["info", str(path)], ["view", str(path), "--force"]):
        code = main(words)
        said = capfd.readouterr().err
        assert code in (0, 2), (words, said)
        assert "unexpected" not in said
    assert dap.animate(dap.open(path), tmp_path / "a.png", at=0.0).frames == 1


def test_names_and_indices_that_lead_nowhere(changed):
    def name(kind, value):
        return lambda d: d[kind].__setitem__(0, value)

    wrong = [name("body", "\x1b[31m"), name("body", "a\nb"), name("body", ""),
             name("point", "\r"), name("point_body", 10**9), name("point_body", -7)]  # fmt: skip
    for change in wrong:
        with pytest.raises(ResultError, match="damaged"):
            dap.open(changed(change))


@pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")
@pytest.mark.parametrize(
    ("value", "codes"), [(np.inf, (2,)), (np.nan, (2,)), (1e300, (2,)), (0.0, (0, 1))]
)
def test_numbers_that_cannot_be_shown(changed, tmp_path, monkeypatch, capfd, value, codes):
    """What no run leaves is refused as the file is read; zeros are shown or refused."""
    path = changed(lambda d: d["u"].__setitem__(slice(None), value))
    monkeypatch.chdir(tmp_path)
    assert main(["view", str(path)]) in codes
    assert "unexpected" not in capfd.readouterr().err


def test_completion_offers_no_words_that_a_shell_would_run(changed, monkeypatch, capsys):
    """Shells put what is offered on the command line as it stands."""
    monkeypatch.setenv("_DAP3D_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_CWORD", "3")
    for name in ("x;touch pwned;", "$(touch pwned)", "`a`", "a b", "'", '"', "|a", "-o=x", ">x"):
        path = changed(lambda d, n=name: d["body"].__setitem__(0, n))
        assert dap.open(path).summary.body_names[0] == name
        monkeypatch.setenv("COMP_WORDS", f"dap3d plot {path} ")
        with pytest.raises(SystemExit):
            main([])
        offered = [word.removeprefix("plain,") for word in capsys.readouterr().out.splitlines()]
        assert not [w for w in offered if name in w]
        assert [w for w in offered if w.startswith("ball")]


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("Jp", np.nan, "Jp holds a number that no scene may have"),
        ("mass", -1.0, "a mass is not positive"),
        ("u", 1e308, "u holds a number that no run leaves"),
        ("t", 5.0, "t holds times that do not increase"),
    ],
)
def test_numbers_that_no_run_leaves_are_refused(changed, name, value, words):
    """They were computed with: a LinAlgError, warnings of numpy, NaN in pictures."""

    def put(dataset):
        dataset.variables[name][(0,) * dataset.variables[name].ndim] = value

    with pytest.raises(ResultError, match=words):
        dap.open(changed(put))


def test_a_name_that_is_not_utf8_is_refused_before_the_run(tmp_path):
    """The NetCDF library takes no other; the run was lost when it was to be saved."""
    scene, begun = dap.Scene(name="fall"), []
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0))
    output = tmp_path / "stone\udcff.nc"
    with pytest.raises(ResultError, match=r"cannot write .* is not UTF-8"):
        dap.simulate(scene, t_end=0.1, dt=0.05, output=output, progress=lambda *t: begun.append(t))
    assert not begun
    with pytest.raises(ResultError, match=r"cannot read .* is not UTF-8"):
        dap.open(output)
    assert not list(tmp_path.iterdir())
