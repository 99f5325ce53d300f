"""The digests under which compiled code is kept."""

import shutil
from pathlib import Path

import pytest
from support.internals import Loop, LoopArrays, Struct, source_digest, source_of, unit_names

import dap3d_core


@pytest.fixture
def core(tmp_path, monkeypatch):
    """A copy of the core's sources that the digest reads."""
    source = Path(dap3d_core.__file__).parent
    root = shutil.copytree(source, tmp_path / "core", ignore=shutil.ignore_patterns("*.pyc"))
    monkeypatch.setattr(source_digest, "__file__", str(root / "kernels/runtime/source_digest.py"))
    yield root
    source_digest.driver_digest.cache_clear()


def digests():
    """Those of formulations and of integrators, read anew."""
    source_digest.driver_digest.cache_clear()
    return source_digest.driver_digest("formulations"), source_digest.driver_digest("integrators")


def test_a_change_in_a_sub_folder_changes_the_digest(core):
    """Else stale code would be run; floors above do not count, those below do."""
    before = digests()
    with (core / "integrators/radau/step.py").open("a") as file:
        file.write("# changed\n")
    changed = digests()
    assert changed[0] == before[0]
    assert changed[1] != before[1]
    with (core / "linear/ldlt/factor.py").open("a") as file:
        file.write("# changed\n")
    assert not set(digests()) & {*before, *changed}


def test_files_that_change_places_change_the_digest(core):
    """Names are compared with their folders: a step.py is in several."""
    before = digests()
    one, other = (core / f"integrators/{name}/step.py" for name in ("radau", "runge_kutta"))
    texts = one.read_bytes(), other.read_bytes()
    one.write_bytes(texts[1])
    other.write_bytes(texts[0])
    assert digests() != before


HELPER = "from functools import cache\n\n\n@cache\ndef helper(x):\n    return {factor} * x\n"
KERNEL = "def kernel(x):\n    return helper(2.0) * x\n"


def kernel_of(folder, places, factor=2.0):
    """A kernel and the helper that it calls, in files of two sub-folders."""
    namespace = {"__name__": "package"}
    texts = {"helper.py": HELPER.format(factor=factor), "kernel.py": KERNEL}
    for (name, text), place in zip(texts.items(), places, strict=True):
        path = folder / place / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
        exec(compile(text, str(path), "exec"), namespace)
    return namespace["kernel"]


def test_sources_do_not_depend_on_the_folders_of_packages(tmp_path):
    """Else ready-made objects of loops would be found in some installations alone."""
    one = kernel_of(tmp_path / "one", ("a", "b"))
    other = kernel_of(tmp_path / "other", ("b", "a"))
    assert source_digest.sources(one) == source_digest.sources(other)


def test_a_change_in_a_helper_that_is_cached_changes_the_sources(tmp_path):
    one = kernel_of(tmp_path / "one", ("a", "b"))
    other = kernel_of(tmp_path / "other", ("a", "b"), factor=3.0)
    assert source_digest.sources(one) != source_digest.sources(other)


def test_a_kernel_is_told_from_that_of_a_file_that_changed_since(tmp_path):
    """A process that goes on with the old code would leave it in the cache for the new."""
    path = tmp_path / "kernel.py"

    def loaded(factor, word="abs"):
        text = f"def kernel(x):\n    return {factor} * {word}(x)\n"
        path.write_text(text)
        namespace = {"__name__": "package"}
        exec(compile(text, str(path), "exec"), namespace)
        return namespace["kernel"]

    kernels = [loaded(2.0, "sum"), loaded(2.0), loaded(3.0)]
    loops = [Loop("one", {"kernel_C": kernel}, ["pass"]) for kernel in kernels]
    names = [unit_names(loop, source_of(loop))[1] for loop in loops]
    assert len(set(names)) == 3


def test_the_layout_of_its_arrays_is_in_both_names_of_a_loop(monkeypatch):
    """Its code reads addresses by their positions in the struct."""
    loop = Loop("nothing", {}, ["pass"])
    before = unit_names(loop, source_of(loop))
    turned = Struct("LoopArrays", LoopArrays.type_of().members[::-1])
    monkeypatch.setattr(LoopArrays, "type_of", classmethod(lambda cls: turned))
    after = unit_names(loop, source_of(loop))
    assert before[0] != after[0]
    assert before[1] != after[1]
