"""Valid files of which one number was changed, their checksums made right again.
So made, or so damaged before they were written, files pass every seal. What is read of them must be
refused in words, or be something that a run could have left: no crash of compiled code, no hang, no
other exception, no warning. An input is the change, as JSON."""

import functools
import json
import math
import shutil
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
from hypothesis import strategies as st
from support.ended import EndedError
from support.internals import Checkpoint, checksum, read_checkpoint, write_checkpoint

import dap3d_core as dap
from dap3d_core.result import ResultError
from fuzz.acceptable import examine_result, strict
from fuzz.damage import seeds
from fuzz.results import HANG, SEAL, in_child

#: What is resumed is watched for so long, s; a child that takes so long hangs.
ENOUGH, PATIENCE = 0.3, 60
#: Model and settings of the runs.
RUNS = {
    "pen1": ("pen1", {"t_end": 200.0, "dt": 0.1}),
    "fourbar3": ("fourbar3", {"t_end": 20.0, "dt": 0.05}),
    "adams": ("pen1", {"t_end": 200.0, "dt": 0.1, "integrator": "adams"}),
    "rk4": ("pen1", {"t_end": 200.0, "dt": 0.1, "integrator": "rk4", "step": 0.01}),
    "radau": ("pen1", {"t_end": 200.0, "dt": 0.1, "integrator": "radau"}),
}
KINDS = (*(("checkpoint", name) for name in RUNS), ("result", "pen1"), ("result", "fourbar3"),
         ("sweep", "pen1"))  # fmt: skip
INTEGERS = (-1, 0, 1, 2, 3, 7, 255, -255, 10**7, -(10**7), 2**31, 2**53, 2**62, -(2**62), 2**63 - 1)
FLOATS = (0.0, -0.0, 1.0, -1.0, 0.5, 1e-9, 1e-320, 1e9, -1e9, 1e99, 1e101, 1e154, 1e308, -1e308,
          math.nan, math.inf, -math.inf)  # fmt: skip


@functools.cache
def folder():
    """Where the good files stand, made once: one folder for each run, and one for the sweep."""
    home = tempfile.TemporaryDirectory()
    folder.home = home  # it lives as long as the process
    for name, (model, settings) in RUNS.items():
        place = Path(home.name, name)
        place.mkdir()
        _leave(model, place, **settings)
    vary, place = {"bodies.cone.mass": [1.0, 2.0]}, Path(home.name, "sweep")
    place.mkdir()
    dap.sweep("pen1", vary, outputs=["cone.r.z", "cone.r.z:end"], t_end=0.05, dt=0.01,
              output=place / "run.nc")  # fmt: skip
    return Path(home.name)


def _leave(model, place, **settings):
    """End a run after two chunks; its result and its checkpoint stay."""
    left = 2

    def watch(standing):
        nonlocal left
        left -= 1
        if not left:
            raise EndedError

    try:
        dap.simulate(model, output=place / "run.nc", watch=watch, checkpoint=math.inf, **settings)
    except EndedError:
        assert (place / "run.nc.checkpoint").exists()
    else:
        raise AssertionError("the run has ended by itself")


@functools.cache
def places(kind, name):
    """Where numbers stand in a file: (what, size or path, whether they are integers)."""
    if kind == "checkpoint":
        found = read_checkpoint(folder() / name / "run.nc.checkpoint")
        arrays = [(k, a.size, a.dtype.kind == "i") for k, a in found.arrays.items() if a.size]
        numbers = [("header", path, type(x) is int) for path, x in _leaves(found.header)]
        # most arrays are long and of little interest: those of few numbers come as often
        return arrays + numbers + [a for a in arrays if a[0].endswith((".integer", ".real"))] * 20
    import netCDF4

    with netCDF4.Dataset(_nc(kind, name)) as dataset:
        variables = [
            (k, v.size, v.dtype.kind == "i")
            for k, v in dataset.variables.items()
            if v.dtype is not str and v.dtype.kind in "if" and v.size
        ]
        numbers = [
            (f"@{k}", path, type(x) is int)
            for k in dataset.ncattrs()
            for path, x in _leaves(_attribute(dataset.getncattr(k)))
        ]
    return variables + numbers


def _nc(kind, name):
    return folder() / ("sweep" if kind == "sweep" else name) / "run.nc"


def _attribute(value):
    if isinstance(value, str):
        try:
            return json.loads(value)
        except ValueError:
            return value
    return value.item() if hasattr(value, "item") else value


def _leaves(value, path=()):
    """Path and value of each number in a nest of lists and tables."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _leaves(part, (*path, key))
    elif isinstance(value, list):
        for k, part in enumerate(value):
            yield from _leaves(part, (*path, k))
    elif type(value) in (int, float):
        yield path, value


@st.composite
def changes(draw):
    """A change of one number of a file: JSON with the file, the place and the new value."""
    kind, name = draw(st.sampled_from(KINDS))
    rng = np.random.default_rng(draw(seeds))
    found = places(kind, name)
    what, where, is_integer = found[rng.integers(len(found))]
    if not isinstance(where, tuple):
        where = int(rng.integers(where))
    values = INTEGERS if is_integer else FLOATS
    value = values[rng.integers(len(values))]
    return json.dumps([kind, name, what, where, value]).encode()


def _put(value, path, new):
    """The same nest with another number at a path."""
    if not path:
        return new
    changed = value.copy()
    changed[path[0]] = _put(value[path[0]], path[1:], new)
    return changed


def make(change, place):
    """Write the changed file, with what belongs to it, into an empty folder; its path."""
    kind, name, what, where, value = change
    shutil.copytree(_nc(kind, name).parent, place, dirs_exist_ok=True)
    if kind == "checkpoint":
        path = place / "run.nc.checkpoint"
        found = read_checkpoint(path)
        header, arrays = dict(found.header), dict(found.arrays)
        if what == "header":
            header = _put(header, where, value)
        else:
            arrays[what] = _changed(arrays[what], where, value)
        write_checkpoint(path, Checkpoint(header, arrays))
        return path
    path = place / "run.nc"
    path.write_bytes(path.read_bytes()[:-SEAL])
    import netCDF4

    with netCDF4.Dataset(path, "r+") as dataset:
        dataset.set_auto_maskandscale(False)
        if what.startswith("@"):
            before = dataset.getncattr(what[1:])
            new = _put(_attribute(before), where, value)
            if isinstance(before, str):
                dataset.setncattr_string(what[1:], json.dumps(new))
            else:
                dataset.setncattr(what[1:], _as(before.dtype, value))
        else:
            variable = dataset.variables[what]
            variable[...] = _changed(np.asarray(variable[...]), where, value)
    checksum.write_checksums(path, path.stat().st_size, is_whole=True)
    return path


def _changed(array, where, value):
    new = array.copy()
    new.reshape(-1)[where] = _as(array.dtype, value)
    return new


def _as(dtype, value):
    """A value in the type of an array, cut to its range."""
    if dtype.kind == "i":
        limits = np.iinfo(dtype)
        value = min(max(int(value), limits.min), limits.max)
    return dtype.type(value)


def check_change(data):
    """A file with one number changed is refused in words, or is what a run could have left.

    Raises:
        AssertionError: it is not.
    """
    change = json.loads(data)
    examine = {"checkpoint": _resume, "result": _use, "sweep": _open_sweep}[change[0]]
    with tempfile.TemporaryDirectory() as home, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = make(change, Path(home))
        answer, ending = in_child(examine, path, PATIENCE)
    assert not ending, f"{change}: {ending}"
    good, words = answer
    assert good, f"{change}: {words}"
    return f"{change[0]} {words}"


def _resume(path):
    end = time.monotonic() + ENOUGH

    def watch(standing):
        if time.monotonic() > end:
            raise EndedError

    with strict():
        try:
            examine_result(dap.resume(path, watch=watch))
        except EndedError as error:
            examine_result(error.result)
            return "went on"
        except ResultError as error:
            return _refused(error, path)
        except dap.SimulationError as error:
            if error.result is not None:
                examine_result(error.result)
            return "failed"
    return "done"


def _use(path):
    with strict(HANG):
        try:
            found = dap.open(path)
            repr(found)
            examine_result(found)
            for name in found.force_names:
                if name not in ("gravity", "weight"):
                    repr(found.force(name))
            repr(found.Jac)
            repr(found.to_xarray())
        except ResultError as error:
            return _refused(error, path)
    return "read"


def _open_sweep(path):
    with strict(HANG):
        try:
            repr(dap.open_sweep(path).load())
        except ResultError as error:
            return _refused(error, path)
    return "read"


def _refused(error, path):
    assert str(path.parent) in str(error), error
    return "refused"
