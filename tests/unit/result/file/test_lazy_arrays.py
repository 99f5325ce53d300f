"""Results that are too large for memory stay in their file, and answer as others do."""

import pickle
import textwrap
import tracemalloc
from importlib import import_module

import numpy as np
import pytest
from support import problems
from support.plain import long_in_plain_python
from support.process import run
from support.results import same_bits

import dap3d_core as dap
from dap3d_core.result import arrays as arrays_module
from dap3d_core.result.arrays import Arrays
from dap3d_core.result.file.lazy_arrays import LazyArrays

KEEPING = import_module("dap3d_core.simulation.output.recorder")
READING = import_module("dap3d_core.result.open")
SHORT = {"t_end": 0.6, "dt": 0.01}


@pytest.fixture
def small_limits(monkeypatch):
    """Everything is large, and a block has few rows."""
    monkeypatch.setattr(KEEPING, "LARGE", 200)
    monkeypatch.setattr(READING, "LARGE", 200)
    monkeypatch.setattr(arrays_module, "BLOCK", 300)


@pytest.fixture
def both(tmp_path, monkeypatch, small_limits):
    """The same run in memory, and in its file."""
    module = import_module("dap3d_core.simulation.run")
    monkeypatch.setattr(module, "CHUNK_SECONDS", 1e-9)
    monkeypatch.setattr(module, "FIRST_CHUNK", 1)
    whole = dap.simulate(problems.four_bar(), **SHORT)
    large = dap.simulate(problems.four_bar(), output=tmp_path / "run.nc", **SHORT)
    assert isinstance(whole.arrays, Arrays)
    assert isinstance(large.arrays, LazyArrays)
    return whole, large


def test_a_large_result_is_the_same(both, tmp_path):
    whole, large = both
    assert [f.name for f in tmp_path.iterdir()] == ["run.nc"]
    assert same_bits(large, whole)
    assert large.ledger == whole.ledger
    again = dap.open(tmp_path / "run.nc")
    assert isinstance(again.arrays, LazyArrays)
    assert same_bits(again, whole)
    assert same_bits(pickle.loads(pickle.dumps(again)), whole)
    assert again.reaction("A0")["i"].force.tobytes() == whole.reaction("A0")["i"].force.tobytes()
    assert large.error is None


def test_parts_and_blocks_are_those_of_the_whole(both):
    whole, large = both
    for rows in (slice(1), slice(3, 9), slice(-2, None), slice(0, 20, 3), slice(7, 7)):
        one, other = large.arrays.part(rows), whole.arrays.part(rows)
        assert one.u.tobytes() == other.u.tobytes()
        assert one.t.tobytes() == other.t.tobytes()
    places = np.array([0, 2, 3, 30, 60])
    assert large.arrays.at(places).Lam.tobytes() == whole.arrays.at(places).Lam.tobytes()
    blocks = list(large.arrays.blocks())
    assert len(blocks) > 5
    assert sum(len(block) for block in blocks) == len(large.arrays) == 61
    assert len(dap.view(large).html) > 1000


def test_a_file_may_be_opened_and_dropped_in_threads(tmp_path):
    """HDF5 crashed where some of several handles of one file were closed, or closed meanwhile."""
    dap.simulate(problems.pendulum(), output=tmp_path / "run.nc", **SHORT)
    code = """
        from concurrent.futures import ThreadPoolExecutor
        from importlib import import_module

        import dap3d_core as dap

        import_module("dap3d_core.result.open").LARGE = 0

        def open_and_drop(_):
            for _ in range(20):
                result = dap.open("run.nc")
                result.itself = result  # only the garbage collector drops it
                assert result.u.shape == (61, 13)

        with ThreadPoolExecutor(4) as pool:
            print(len(list(pool.map(open_and_drop, range(8)))))
    """
    assert run(textwrap.dedent(code), cwd=tmp_path) == "8"


@long_in_plain_python
def test_a_file_that_takes_its_name_changes_nothing(both, tmp_path):
    whole, large = both
    dap.simulate(problems.pendulum(), output=tmp_path / "run.nc", force=True, **SHORT)
    assert same_bits(large, whole)


@long_in_plain_python
def test_a_large_result_is_saved_again_over_itself(both, tmp_path):
    whole, large = both
    large.save(tmp_path / "run.nc", force=True)
    assert same_bits(dap.open(tmp_path / "run.nc"), whole)
    large.arrays = large.arrays.with_error(np.abs(large.u))
    large.save(tmp_path / "run.nc", force=True)
    assert dap.open(tmp_path / "run.nc").error.u.tobytes() == np.abs(whole.u).tobytes()


@pytest.mark.slow
def test_the_ledger_of_a_large_result_takes_little_memory(monkeypatch, tmp_path):
    """A hundredth of the arrays, but for the numbers of each instant that it compares."""
    monkeypatch.setattr(READING, "LARGE", 200)
    monkeypatch.setattr(arrays_module, "BLOCK", 2**12)
    scene = problems.chain(40)
    dap.simulate(scene, t_end=1.0, dt=1e-3, rtol=1e-4, output=tmp_path / "run.nc")
    result = dap.open(tmp_path / "run.nc")
    tracemalloc.start()
    assert result.ledger["position"].ok
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 8 * len(result.arrays) * result.arrays.width > 5e6
    assert peak < 1e6


LONG = """
import resource
from importlib import import_module
import dap3d_core as dap
for name in ("result.open", "simulation.output.recorder"):
    import_module(f"dap3d_core.{name}").LARGE = 2**24
scene = dap.Scene(name="ten")
for k in range(10):
    scene.add_body(f"b{k}", mass=1.0, Jp=[0.1, 0.1, 0.1], r=[0.5 + k, 0, 0])
    scene.add_point(f"in{k}", body=f"b{k}", sPp=[-0.5, 0, 0])
    scene.add_point(f"out{k}", body=f"b{k}", sPp=[0.5, 0, 0])
    before = f"out{k - 1}" if k else "ground.O"
    scene.add_joint("sph", f"J{k}", P_i=f"in{k}", P_j=before)
scene.add_force("weight", "gravity")
peaks = []
for count in (1_000, 50_000):
    settings = dict(t_end=count * 1e-4, dt=1e-4, rtol=1e-5, output="run.nc", force=True)
    result = dap.simulate(scene, **settings)
    assert result.ledger["position"].ok, len(result.t) == count + 1
    peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
print(peaks[1] - peaks[0], result.arrays.width * 8 * count / 2**20)
"""


@pytest.mark.slow
def test_a_long_run_takes_little_memory(tmp_path):
    """Of 50 000 instants, 87 MiB, memory holds 16 MiB (LARGE) for a moment, and some to work."""
    more, rows = map(float, run(LONG, cwd=tmp_path).split())
    assert rows > 80.0
    assert more < 48.0
