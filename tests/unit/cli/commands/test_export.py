"""``dap3d export MODEL``: C libraries and FMUs."""

import json
import shutil
import zipfile

import pytest
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.cli import main

pytestmark = [
    pytest.mark.usefixtures("quick_libraries"),
    pytest.mark.skipif(
        not (jit_is_on() and (shutil.which("cc") or shutil.which("gcc"))), reason="no C compiler"
    ),
]


@pytest.mark.slow
def test_a_model_is_written_as_a_folder_and_not_over_another(tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["export", "pen1", "-o", "made", "--quantity", "cone.r"]
    assert main(words) == 0
    assert "made written: 3 outputs" in capfd.readouterr().out
    names = {path.name for path in (tmp_path / "made").iterdir()}
    assert {"dap3d.h", "variables.h", "example.c", "CMakeLists.txt", "README.md"} < names
    assert main(words) == 2
    assert "--force overwrites it" in capfd.readouterr().err
    assert main([*words, "--force"]) == 0


@pytest.mark.slow
@pytest.mark.parametrize("fmi", ["3", "2"])
def test_an_fmu_is_chosen_by_its_suffix(tmp_path, capfd, fmi):
    target = tmp_path / "pen1.fmu"
    assert main(["export", "pen1", "-o", str(target), "--fmi", fmi, "--json"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert (found["format"], found["file"]) == ("fmu", str(target))
    assert "cone.r.z" in found["outputs"]
    with zipfile.ZipFile(target) as archive:
        assert f'fmiVersion="{fmi}.0"' in archive.read("modelDescription.xml").decode()


@pytest.mark.slow
def test_settings_are_those_of_a_run(tmp_path):
    """Steps of 20 ms show in bits; tolerances of some quantities as well."""
    for words, given in (
        (["--integrator", "rk4", "--step", "0.02"], {"integrator": "rk4", "step": 0.02}),
        (["--atol", "r=1e-4,w=1e-3", "--no-project"],
         {"atol": {"r": 1e-4, "w": 1e-3}, "project": False}),
    ):  # fmt: skip
        target = tmp_path / "pen1"
        assert main(["export", "pen1", "-o", str(target), "--force", *words]) == 0
        run = dap.load_native(target).start(0.5)
        run.step_to(0.5)
        expected = dap.simulate("pen1", t_end=0.5, dt=0.5, **given).quantity("cone.r.x").values[-1]
        assert run["cone.r.x"] == expected


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--integrator", "rk4"], "--step: rk4 does not choose its step"),
        (["--rtol", "7"], "--rtol = 7.0: should be at most 1"),
        (["--format", "urdf", "--no-project"], "--project is of formats c and fmu"),
        (["--format", "urdf", "--contact-step", "1e-3"], "--contact-step is of formats c and fmu"),
    ],
)
def test_wrong_settings_are_told_by_their_options(tmp_path, monkeypatch, capfd, words, said):
    monkeypatch.chdir(tmp_path)
    assert main(["export", "pen1", "-o", "made", *words]) == 2
    assert said in capfd.readouterr().err
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("suffix", [".c", ".h"])
def test_a_file_of_c_is_answered_by_the_folder_to_give(tmp_path, monkeypatch, capfd, suffix):
    monkeypatch.chdir(tmp_path)
    for more in ([], ["--format", "c"]):
        assert main(["export", "pen1", "-o", f"made{suffix}", *more]) == 2
        said = capfd.readouterr().err
        assert "format c is a folder" in said
        assert "give made\n" in said
    assert not [*tmp_path.iterdir()]
