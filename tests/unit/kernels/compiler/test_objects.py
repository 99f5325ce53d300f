"""Object code in files: damaged it is never run, and nothing that happens to files ends a run."""

import ctypes
import os
import resource
from functools import partial
from itertools import count

import numpy as np
import pytest
from support.internals import FLOAT, Array, Program, Signature, background, objects, units
from support.plain import jit_is_on
from support.process import run, start, together

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")


def doubled(x, out):
    out[0] = 2.0 * x


SIGNATURE = Signature((FLOAT, Array(FLOAT, 1)))


def write(symbols):
    """As ``Unit`` asks for it."""
    program = Program()
    program.export(doubled, SIGNATURE.arguments, *symbols)
    return program.module(), ["None"]


def entry_of(folder, **options):
    return units.Entry(units.Unit("doubled", 1, write, folder, **options), 0, SIGNATURE)


def answer(entry):
    out = np.zeros(1)
    entry(21.0, out)
    return out[0]


@pytest.fixture
def alone(monkeypatch):
    """One core: nothing is compiled in the background."""
    monkeypatch.setattr(background, "core_count", lambda: 1)
    monkeypatch.setattr(background, "optimiser", background.Optimiser())


@pytest.mark.parametrize("damage", ["cut", "changed", "empty", "head", "text"])
def test_a_damaged_object_is_made_anew_and_noted(tmp_path, alone, damage):
    entry_of(tmp_path, optimise=True)
    path = tmp_path / "doubled.o"
    data = path.read_bytes()
    path.write_bytes({"cut": data[:-7], "changed": data[:-7] + b"damaged", "empty": b"",
                      "head": b"x" + data[1:], "text": b"[]\n"}[damage])  # fmt: skip
    units.compiled_units.clear()
    with pytest.warns(RuntimeWarning, match=r"damaged and is made anew: .*doubled\.o"):
        assert answer(entry_of(tmp_path, optimise=True)) == 42.0
    assert units.compiled_units == ["doubled"]
    assert path.read_bytes() == data
    assert answer(entry_of(tmp_path)) == 42.0
    assert units.compiled_units == ["doubled"]


def test_without_a_folder_code_is_in_memory_alone(alone):
    assert answer(entry_of(None)) == 42.0


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write all")
def test_a_folder_that_may_only_be_read_does_no_harm(tmp_path, alone):
    tmp_path.chmod(0o500)
    assert answer(entry_of(tmp_path, optimise=True)) == 42.0


def test_a_full_disk_does_no_harm(tmp_path, alone):
    """A file that could not be written whole leaves nothing behind."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
    try:
        assert answer(entry_of(tmp_path, optimise=True)) == 42.0
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


def test_objects_not_used_for_longest_go_first(tmp_path, monkeypatch):
    monkeypatch.setattr(objects, "MAX_BYTES", 1000)
    monkeypatch.setattr(objects, "CLEAN_EVERY", 1)
    for k in range(4):
        objects.write_object(tmp_path / f"{k}.o", None, bytes(300))
        os.utime(tmp_path / f"{k}.o", (k, k))
    assert sorted(f.name for f in tmp_path.iterdir()) == ["2.o", "3.o"]


def test_a_folder_is_read_for_the_first_of_many_objects_alone(tmp_path, monkeypatch):
    """Each pass over it takes time in proportion to what it holds."""
    monkeypatch.setattr(objects, "_written", count())
    cleaned = []
    monkeypatch.setattr(objects, "_clean", cleaned.append)
    for k in range(objects.CLEAN_EVERY + 1):
        objects.write_object(tmp_path / f"{k}.o", None, b"")
    assert cleaned == [tmp_path, tmp_path]


def test_files_that_killed_processes_left_behind_are_removed(tmp_path, monkeypatch):
    """Not those of processes at work, nor files that are not the compiler's."""
    for name in ("old.1.ll", ".old.o.ab", ".old.1.ll.ab", "new.2.ll", "notes.txt"):
        (tmp_path / name).touch()
        if not name.startswith("new"):
            os.utime(tmp_path / name, (0, 0))
    monkeypatch.setattr(objects, "CLEAN_EVERY", 1)
    objects.write_object(tmp_path / "a.o", None, b"")
    assert sorted(f.name for f in tmp_path.iterdir()) == ["a.o", "new.2.ll", "notes.txt"]


def test_code_is_made_well_once_it_has_run_for_long(tmp_path, alone, monkeypatch):
    """On one core; a table then holds the better code, and so do calls from Python."""
    unit = units.Unit("doubled", 1, write, tmp_path)
    entry = units.Entry(unit, 0, SIGNATURE)
    table = units.Functions(SIGNATURE, [entry])
    assert answer(entry) == 42.0
    quick = unit.addresses[0]
    assert not unit.is_optimised
    assert list(tmp_path.iterdir()) == []
    background.optimiser._polled = 0.0
    background.optimiser.poll(unit.cost + 1.0)
    assert unit.is_optimised
    assert table.addresses[0] == unit.addresses[0] != quick
    kind = ctypes.CFUNCTYPE(None, ctypes.c_double, ctypes.c_void_p, ctypes.c_int64)
    out = np.zeros(1)
    kind(int(table.addresses[0]))(1.5, out.ctypes.data, 1)
    assert out[0] == 3.0
    assert answer(entry) == 42.0
    assert (tmp_path / "doubled.o").exists()


@pytest.mark.slow
def test_a_process_beside_makes_code_well(tmp_path, monkeypatch):
    """Its objects are taken over by the next look after they are there."""
    monkeypatch.setattr(background, "core_count", lambda: 2)
    optimiser = background.Optimiser()
    monkeypatch.setattr(background, "optimiser", optimiser)
    unit = units.Unit("doubled", 1, write, tmp_path)
    entry = units.Entry(unit, 0, SIGNATURE)
    optimiser._process.stdin.close()
    assert optimiser._process.wait(timeout=120) == 0
    assert [f.name for f in tmp_path.iterdir()] == ["doubled.o"]
    optimiser._polled = 0.0
    optimiser.poll(0.0)
    assert unit.is_optimised
    assert not optimiser.units
    assert answer(entry) == 42.0


def test_threads_may_ask_for_one_function_at_once(tmp_path, alone):
    entry = entry_of(tmp_path)
    assert together(*[partial(answer, entry)] * 8) == [42.0] * 8


RUN = """
import dap3d_core as dap
r = dap.simulate("bodies2", t_end=0.02, dt=0.01)
print(r.u.tobytes().hex()[:400])
"""


@pytest.mark.slow
def test_processes_that_race_on_an_empty_cache_have_the_same_bits(tmp_path):
    racers = [start(RUN, tmp_path / "cache") for _ in range(2)]
    said = [p.communicate(timeout=300)[0] for p in racers]
    assert [p.returncode for p in racers] == [0, 0]
    assert len(set(said)) == 1
    assert run(RUN, tmp_path / "cache") == said[0].strip()


@pytest.mark.parametrize("wrong", [np.zeros(3, dtype=np.float32), np.zeros((3, 3))[:, 0]])
def test_arrays_that_compiled_code_would_misread_are_refused(wrong):
    with pytest.raises(TypeError, match="C-contiguous"):
        units.type_of(wrong)
