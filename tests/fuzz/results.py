"""Files of results and sweeps with damaged bytes, and what must be true of reading them.
The HDF5 library itself crashes on some damaged files and never ends on others, so a file is read
in a child process. A file with a seal is refused before the library sees it; for others, as older
programs wrote them, such an end is counted, and is no find (``CRASHED``, ``STUCK``)."""

import functools
import os
import pickle
import select
import signal
import tempfile
import traceback
import warnings
from pathlib import Path

import numpy as np
from hypothesis import strategies as st
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core.result import ResultError, open_result
from fuzz.acceptable import ARRAYS, file_of, strict
from fuzz.damage import seeds

#: A file that takes longer to read hangs, s; in compiled code no signal is heard before its end.
HANG, PATIENCE = 5, 10
CRASHED, STUCK = "the HDF5 library crashed", "the HDF5 library was stuck"
#: Bytes of a seal.
SEAL = 40
#: Signals by which a process ends that the library has corrupted.
_CRASHES = (signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGFPE)


def is_sealed(data):
    return b"dap3dsum" in data[-SEAL:]


@functools.cache
def good_files():
    """The bytes of files as they are saved: runs of one body and of several, a sweep; one of a run
    has no seal."""
    with tempfile.TemporaryDirectory() as folder:
        for name in ("pen1", "fourbar3"):
            run = dap.simulate(REPOSITORY / "models" / name, t_end=0.05, dt=0.01)
            run.save(Path(folder, f"{name}.nc"))
        vary, output = {"bodies.cone.mass": [1.0, 2.0]}, Path(folder, "sweep.nc")
        dap.sweep("pen1", vary, outputs="cone.r", t_end=0.05, dt=0.01, output=output)
        sealed = [p.read_bytes() for p in sorted(Path(folder).iterdir())]
        return [*sealed, *sealed, sealed[0][:-SEAL]]


@st.composite
def damaged_results(draw):
    """The bytes of a result file of which some were changed, cut off or doubled."""
    data = draw(st.sampled_from(good_files()))
    rng = np.random.default_rng(draw(seeds))
    array = np.frombuffer(data, dtype=np.uint8).copy()
    way = draw(st.sampled_from(("bytes", "bytes", "bytes", "zeros", "cut", "copy")))
    at, length = int(rng.integers(len(array))), int(10 ** rng.uniform(0, 3))
    if way == "bytes":
        places = rng.integers(len(array), size=draw(st.integers(1, 20)))
        array[places] = rng.integers(256, size=len(places))
    elif way == "zeros":
        array[at : at + length] = 0
    elif way == "cut":
        array = array[:at]
    else:
        other = int(rng.integers(len(array) - length))
        piece = array[other : other + length][: len(array) - at].copy()
        array[at : at + len(piece)] = piece
    return array.tobytes()


def examine_file(path):
    """A file is read, or refused as a result; what was read can be asked for.
    That of a sweep is not known by its damaged bytes, so each file is read as both."""
    with strict(HANG):
        found = _read(open_result, path)
        if found is None:
            swept = _read(dap.open_sweep, path)
            if swept is None:
                return "refused"
            repr(swept.load())
            return "read"
        repr(found)
        assert found.status in ("done", "stopped", "interrupted")
        with np.errstate(all="ignore"):  # numbers that were damaged may overflow
            for name in ARRAYS:
                getattr(found, name)
            found.ledger  # noqa: B018 - computed when asked for
    return "read" if np.isfinite(found.u).all() else "read, not finite"


def _read(reader, path):
    """What a reader makes of a file; None where it refuses it."""
    try:
        return reader(path)
    except ResultError as error:
        if str(path) not in str(error):
            raise
        return None


def check_result(data):
    """``examine_file`` in a process of its own.

    Raises:
        AssertionError: it failed there; holds the traceback. Or a sealed file was read though it is
            damaged, or came to the library.
    """
    with file_of(data, "run.nc") as path:
        answer, ending = in_child(examine_file, path)
    if ending:
        assert not is_sealed(data)
        return ending
    good, words = answer
    assert good, words
    assert words == "refused" or not is_sealed(data) or data in good_files()
    return words


def in_child(examine, path, patience=PATIENCE):
    """What ``examine`` makes of a file in a process of its own, which may crash or never end.

    Returns:
        (whether it returned, what it returned or its traceback); how else it ended, in words.
    """
    receive, send = os.pipe()
    with warnings.catch_warnings():  # of threads, which the child has no use for
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        _examine_and_leave(examine, path, send)
    os.close(send)
    with os.fdopen(receive, "rb") as stream:
        is_stuck = not select.select([stream], [], [], patience)[0]
        if is_stuck:
            os.kill(child, signal.SIGKILL)
        answer = stream.read()
    _, status = os.waitpid(child, 0)
    if is_stuck or (os.WIFSIGNALED(status) and os.WTERMSIG(status) in _CRASHES):
        return None, STUCK if is_stuck else CRASHED
    return pickle.loads(answer) if answer else (False, f"the child ended with {status}"), ""


def _examine_and_leave(examine, path, send):
    try:
        found = True, examine(path)
    except BaseException:
        found = False, traceback.format_exc()
    with os.fdopen(send, "wb") as stream:
        stream.write(pickle.dumps(found))
    os._exit(0)
