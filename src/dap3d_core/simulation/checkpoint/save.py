"""Checkpoints of a run: when they are written, and their content."""

import hashlib
import json
import math
import os
import time
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from tokenize import TokenError
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.arrays import CHECKPOINTED
from dap3d_core.integrators.stepping.integration_state import MOST_COUNTED
from dap3d_core.kernels.runtime.source_digest import driver_digest
from dap3d_core.result import Computed, Result, ResultError, current_versions, open_result
from dap3d_core.result.file import validate
from dap3d_core.result.file.atomic_write import beginning, whole_file
from dap3d_core.result.metadata import to_json
from dap3d_core.settings import METHODS
from dap3d_core.simulation.errors import CheckpointError
from dap3d_core.simulation.run_state import RunState

#: Version of this layout, raised when an older reader would misread it.
FORMAT = 3
PROGRAM = "dap3d checkpoint"
#: Key of the digest of all the rest.
DIGEST = "digest"
#: Added to the name of the result file.
SUFFIX = ".checkpoint"


def is_count(value: Any) -> bool:
    """True for a count that a double holds exactly."""
    return type(value) is int and 0 <= value <= MOST_COUNTED


def _is_duration(value: Any) -> bool:
    return validate.is_number(value) and value >= 0.0


def _has_titles(value: Any) -> bool:
    return value is None or (isinstance(value, dict) and validate.are_texts(value.get("titles")))


#: Keys of a header.
KEYS: dict[str, validate.Form] = {
    **dict.fromkeys(("run", "output", "scene", "driver", DIGEST), (validate.is_text, "a text")),
    "method": (lambda value: value in METHODS, f"one of {', '.join(METHODS)}"),
    "integrations": (lambda value: type(value) is int and value in (1, 2), "1 or 2"),
    "crossed": (validate.list_of(_is_duration), "a list of times in seconds"),
    "until": (lambda value: value is None or _is_duration(value), "a time in seconds, or null"),
    "rows": (is_count, "a count"),
    **dict.fromkeys(("t", "wall_time_s", "compile_time_s"), (_is_duration, "a time in seconds")),
    "settings": (lambda value: isinstance(value, dict), "a table"),
    "estimate_error": (lambda value: isinstance(value, bool), "true or false"),
    "notes": (validate.are_texts, "a list of texts"),
    **dict.fromkeys(("types", "versions"), (validate.is_table_of_texts, "a table of texts")),
    **dict.fromkeys(("events", "controllers"), (_has_titles, "a table with titles, or nothing")),
}

_HEADER = "checkpoint.json"
#: What readers of archives and arrays raise for damaged ones.
_UNREADABLE = (
    zipfile.BadZipFile, RuntimeError, EOFError, ValueError, OSError, MemoryError, KeyError,
    TokenError,
)  # fmt: skip
_ZIP = b"PK\x03\x04"
#: A header with the scene's text is larger than a scene may be, but not by much.
_LARGEST_HEADER = 2**28


@attrs.frozen(eq=False)
class Checkpoint:
    """A run on its way.

    Attributes:
        header: what is no array: the scene's text, settings, notes and the like (resume.py).
        arrays: the state of the integrations and of the model's arrays, by name.
    """

    header: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]]


def path_of(output: Path) -> Path:
    """Path of the checkpoint of a run, from its result file."""
    return output.with_name(output.name + SUFFIX)


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint, whole or not at all, over an older one.

    Raises:
        ResultError: it cannot be written; an older one stays as it was.
    """
    header = {
        "program": PROGRAM,
        "format": FORMAT,
        "versions": current_versions(),
        **checkpoint.header,
    }
    header[DIGEST] = digest_of(header, checkpoint.arrays)
    with (
        whole_file(path, force=True) as part,
        zipfile.ZipFile(part, "w", zipfile.ZIP_STORED, allowZip64=True) as archive,
    ):
        archive.writestr(_HEADER, json.dumps(header))
        for name, array in checkpoint.arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                plain = np.ascontiguousarray(array)
                np.lib.format.write_array(member, plain, (1, 0), allow_pickle=False)


def digest_of(header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> str:
    """Digest of all that a checkpoint holds, as hexadecimal digits."""
    text = json.dumps(header, sort_keys=True)
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass"))
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"\n{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def read_checkpoint(path: str | os.PathLike[str]) -> Checkpoint:
    """Read a checkpoint.

    Raises:
        CheckpointError: there is none, it is another file, of a newer program, cut off or damaged.
    """
    file = Path(path)
    _check_signature(file)
    try:
        with zipfile.ZipFile(file) as archive:
            infos = archive.infolist()
            if any(info.compress_type != zipfile.ZIP_STORED for info in infos):
                raise _foreign(file)
            header = _header(file, archive)
            arrays = {
                info.filename.removesuffix(".npy"): _array(archive, info)
                for info in infos
                if info.filename.endswith(".npy")
            }
        if header.pop(DIGEST) != digest_of(header, arrays):
            raise CheckpointError(
                f"cannot resume from {file}: it was changed since it was written (its digest is of "
                "other numbers). Resume from a copy that was not, or run the scene anew"
            )
    except CheckpointError:
        raise
    except _UNREADABLE as error:
        raise CheckpointError(
            f"cannot resume from {file}: it is cut off or damaged ({error}); the rows that its run "
            "had written are in its result file"
        ) from error
    return Checkpoint(header, arrays)


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    """One array; its size is checked before memory is taken."""
    with archive.open(info) as member:
        np.lib.format.read_magic(member)
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(member)
        size = dtype.itemsize * math.prod(shape)
        if dtype.kind not in "fic" or fortran or size > info.file_size:
            raise ValueError(f"{info.filename} is no plain array")
        content = member.read()  # at the end the archive compares its checksum
    return np.frombuffer(content, dtype).reshape(shape)


def _check_signature(file: Path) -> None:
    try:
        begin = beginning(file, len(_ZIP))
    except ResultError as error:
        raise CheckpointError(str(error)) from error
    if not begin:
        raise CheckpointError(f"cannot resume from {file}: the file is empty")
    if begin.startswith(b"\x89HDF"):
        raise CheckpointError(
            f"cannot resume from {file}: it is a result; its checkpoint, where there is one, is "
            f"{file.name.removesuffix('.part')}{SUFFIX}"
        )
    if begin != _ZIP:
        raise _foreign(file)


def _foreign(file: Path) -> CheckpointError:
    return CheckpointError(f"cannot resume from {file}: it is no checkpoint of dap3d")


def _header(file: Path, archive: zipfile.ZipFile) -> dict[str, Any]:
    if _HEADER not in archive.namelist():
        raise _foreign(file)
    if archive.getinfo(_HEADER).file_size > _LARGEST_HEADER:
        raise _foreign(file)
    header = json.loads(archive.read(_HEADER))
    if not isinstance(header, dict) or header.get("program") != PROGRAM:
        raise _foreign(file)
    if header.get("format") != FORMAT:
        made = header.get("versions", {}).get("dap3d", "another version")
        raise CheckpointError(
            f"cannot resume from {file}: dap3d {made} wrote it in format {header.get('format')}, "
            f"this program reads format {FORMAT}; install that version of dap3d"
        )
    validate.check_forms(header, KEYS)
    return header


class CheckpointWriter:
    """Writes the checkpoints of a run.

    Attributes:
        path: where they stand.
        has_written: whether there is one of this run.
    """

    def __init__(self, run: RunState, seconds: float, *, force: bool) -> None:
        """Args:
            run: the run, which has an output.
            seconds: from one checkpoint to the next.
            force: give up a checkpoint of another run.

        Raises:
            ResultError: there is one of another run.
        """
        assert run.recorder.output is not None
        self.path = path_of(run.recorder.output)
        if self.path.exists() and not force:
            raise ResultError(
                f"{self.path} exists: a run that was ended goes on from it (dap3d resume); force "
                "gives it up"
            )
        self.has_written = False
        self._run, self._seconds = run, seconds
        self._next = time.perf_counter() + seconds

    def begin(self) -> None:
        """Write the first checkpoint before anything is integrated, where more are to follow.

        So a run that is killed at any later moment can be resumed.
        """
        if math.isfinite(self._seconds):
            self._save()

    def update(self) -> None:
        """Write a checkpoint if it is time."""
        if time.perf_counter() >= self._next:
            self._save()

    def _save(self) -> None:
        self._run.recorder.to_disk(lambda: self._run.record("done"))
        self.write()
        self._next = time.perf_counter() + self._seconds

    def leave(self, error: BaseException) -> None:
        """Write a checkpoint where a run is ended from outside, its result being saved.

        ``error.checkpoint`` names it, if the run is between two chunks.
        """
        run = self._run
        if run.is_whole:
            self.write()
            Computed(checkpoint=self.path).attach(error)

    def write(self) -> None:
        """Write a checkpoint of the present run, once its rows are in a file."""
        write_checkpoint(self.path, checkpoint_of(self._run))
        self.has_written = True

    def remove(self) -> None:
        """The run has finished and is not resumed. The checkpoint is removed last.

        That of another run, which has taken its place, stays.
        """
        recorder = self._run.recorder
        assert recorder.output is not None
        remove_parts(recorder.output, recorder.run)
        with suppress(CheckpointError):
            if read_checkpoint(self.path).header["run"] == recorder.run:
                self.path.unlink(missing_ok=True)


def results_of(files: Iterable[Path], run: str) -> Iterator[tuple[Path, Result]]:
    """Those of some files that can be read and are of a run, given its identity."""
    for file in files:
        with suppress(ResultError):
            result = open_result(file)
            if result.record.run == run:
                yield file, result


def parts_of(output: Path) -> list[Path]:
    """Unfinished files next to a result file."""
    return sorted(output.parent.glob(f"{output.name}.part*"))


def remove_parts(output: Path, run: str, *, kept: Path | None = None) -> None:
    """Remove the unfinished files that a run has left next to its result file, except one."""
    for part, _ in results_of(parts_of(output), run):
        if part != kept:
            part.unlink()


def checkpoint_of(run: RunState) -> Checkpoint:
    """State of a run between two chunks, its rows taken."""
    recorder, compiled = run.recorder, run.compiled
    assert recorder.output is not None
    header: dict[str, Any] = {
        "run": recorder.run,
        "output": recorder.output.name,
        "rows": recorder.count,
        "t": run.present.t,
        "integrations": len(run.integrations),
        "crossed": run.crossed,
        "until": run.until if math.isfinite(run.until) else None,
        "scene": compiled.scene_text,
        "method": compiled.requested_method,
        "formulation": compiled.method,
        "settings": attrs.asdict(run.settings),
        "estimate_error": run.estimate_error is True,
        "start_is_interpolated": run.start is not None and run.start.is_interpolated,
        "start_without": [] if run.start is None else list(run.start.ended),
        "notes": run.notes,
        "wall_time_s": time.perf_counter() - run.started,
        "compile_time_s": run.compile_time,
        "driver": driver_digest("integrators"),
        "types": {name: one["digest"] for name, one in compiled.types.items()},
    }
    if run.event_locator is not None:
        header["events"] = run.event_locator.state()
    if run.jumps is not None:
        header["jumps"] = run.jumps.state()
    if run.control is not None:
        header["controllers"] = run.control.state(run.integrations)
    return Checkpoint(json.loads(to_json(header)), arrays_of(run))


def arrays_of(run: RunState) -> dict[str, NDArray[Any]]:
    """Arrays from which a run is resumed, by name."""
    found = {
        f"{k}.{name}": array
        for k, integration in enumerate(run.integrations)
        for name, array in integration.all_arrays()
    }
    if run.start is not None:
        found["start.u"] = run.start.u
        if run.start.angles is not None:
            found["start.angles"] = run.start.angles
        if run.start.states is not None:
            found["start.states"] = run.start.states
    return found | {f"system.{name}": getattr(run.evaluator.system, name) for name in CHECKPOINTED}
