"""``dap3d export MODEL``: C libraries and FMUs."""

import json
import shutil
import zipfile

import pytest
from support.plain import jit_is_on

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


@pytest.mark.every(2)
@pytest.mark.parametrize("fmi", ["3", "2"])
def test_an_fmu_is_chosen_by_its_suffix(tmp_path, capfd, fmi):
    target = tmp_path / "pen1.fmu"
    assert main(["export", "pen1", "-o", str(target), "--fmi", fmi, "--json"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert (found["format"], found["file"]) == ("fmu", str(target))
    assert "cone.r.z" in found["outputs"]
    with zipfile.ZipFile(target) as archive:
        assert f'fmiVersion="{fmi}.0"' in archive.read("modelDescription.xml").decode()


@pytest.mark.parametrize("suffix", [".c", ".h"])
def test_a_file_of_c_is_answered_by_the_folder_to_give(tmp_path, monkeypatch, capfd, suffix):
    monkeypatch.chdir(tmp_path)
    for more in ([], ["--format", "c"]):
        assert main(["export", "pen1", "-o", f"made{suffix}", *more]) == 2
        said = capfd.readouterr().err
        assert "format c is a folder" in said
        assert "give made\n" in said
    assert not [*tmp_path.iterdir()]
