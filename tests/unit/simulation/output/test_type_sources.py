"""Results know the sources of their types: formulas that have changed since are never used."""

import importlib
import shutil
import sys

import pytest
from support import problems

import dap3d_core as dap
from dap3d_core.result import ResultError, open_result
from dap3d_core.simulation.output.type_sources import digest_of

SHORT = {"t_end": 0.1, "dt": 0.02}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The result file of a model that has a type of its own."""
    file = tmp_path_factory.mktemp("recorded") / "run.nc"
    dap.simulate("ball1", allow_code=True, output=file, **SHORT)
    return file


@pytest.fixture
def thrown(recorded, tmp_path):
    """The model's folder, of one's own, and beside it the result."""
    shutil.copy(recorded, tmp_path)
    return shutil.copytree(dap.shipped_models()["ball1"], tmp_path / "ball1")


def changed(folder):
    """Give the model's own type another formula."""
    file = folder / "plugin.py"
    file.write_text(file.read_text() + "\nEXTRA = 1\n")


def test_with_the_same_sources_forces_are_computed_without_a_word(thrown):
    found = dap.open(thrown.with_name("run.nc"), model=thrown, allow_code=True)
    assert found.record.types["force ball-contact"]["digest"]
    assert found.record.types["force weight"]["distribution"] == "dap3d"
    assert found.model.force_names
    assert not [note for note in found.notes if "sources" in note]


def test_with_other_formulas_what_they_give_is_refused(thrown):
    """What is stored is still there."""
    file = thrown.with_name("run.nc")
    changed(thrown)
    found = dap.open(file, model=thrown, allow_code=True)
    name = found.force_names[-1]
    words = r"formulas of force ball-contact \(plugin\.py\) have changed since the run"
    for use in (lambda: found.force(name), lambda: found.Jac, lambda: found.model):
        with pytest.raises(ResultError, match=words):
            use()
    assert found.energy.total.shape == found.t.shape


def test_comments_are_no_formulas(thrown):
    """A release that explains a type better leaves results of the one before usable."""
    file = thrown / "plugin.py"
    file.write_text('"""Another docstring."""\n# another comment\n' + file.read_text())
    found = dap.open(thrown.with_name("run.nc"), model=thrown, allow_code=True)
    assert found.force("contact")


def test_a_run_is_made_again_with_other_formulas_and_that_is_told(thrown):
    file = thrown.with_name("run.nc")
    assert dap.rerun(file, model=thrown, allow_code=True).types == []
    changed(thrown)
    found = dap.rerun(file, model=thrown, allow_code=True)
    assert found.types == ["force ball-contact (plugin.py)"]


def test_a_result_without_a_record_of_its_types_says_so(tmp_path):
    """As older programs wrote it: it is read, and what cannot be compared is noted, once."""
    result = dap.simulate(problems.pendulum(), **SHORT)
    object.__setattr__(result.record, "types", None)
    result.save(tmp_path / "old.nc")
    found = dap.open(tmp_path / "old.nc")
    assert sum("which sources its types had" in note for note in found.notes) == 1
    assert found.model.joint_names
    assert open_result(tmp_path / "old.nc").record.types is None


def test_a_result_whose_scene_is_of_another_size_is_not_run_again():
    result = dap.simulate(problems.pendulum(), **SHORT)
    object.__setattr__(result.record, "scene_text", problems.four_bar().to_toml())
    with pytest.raises(ResultError, match="other bodies or joints"):
        dap.rerun(result)


def test_a_digest_covers_what_a_type_uses_of_its_package(tmp_path, monkeypatch):
    """A formula may stand in a module beside; what the type does not use is another matter."""
    package = tmp_path / "pack_of_types"
    package.mkdir()
    (package / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)

    def digest(law, other, symbol="ball"):
        (package / "kinds.py").write_text(
            "from pack_of_types.laws import law\n\n"
            f"class Kind:\n    symbol = {symbol!r}\n    f = law\n"
        )
        (package / "laws.py").write_text(f"def law(x):\n    return {law} * x\n")
        (package / "others.py").write_text(f"number = {other}\n")
        for name in [name for name in sys.modules if name.startswith("pack_of_types")]:
            del sys.modules[name]
        importlib.invalidate_caches()
        importlib.import_module("pack_of_types.others")
        return digest_of(importlib.import_module("pack_of_types.kinds").Kind)

    first = digest(1.0, 1)
    assert first
    assert digest(1.0, 2) == first
    assert digest(1.0, 1, symbol="ring") == first
    assert digest(10.0, 1) != first
