"""Files that commands read and write, refused before any work is done."""

import math
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dap3d_core.cli.process.exit_codes import Refused, refusing

if TYPE_CHECKING:
    import xarray

    from dap3d_core.result import Result

#: Suffixes of results, and of scenes.
RESULTS, SCENES = (".nc",), (".toml",)


def named_after(model: str, output: str | None, tail: str = "") -> Path:
    """The file of a result: ``output``, by default MODEL and a tail in the current folder."""
    if output is not None:
        return Path(output)
    path = Path(model)
    if path.is_file():
        return Path(f"{path.stem}{tail}.nc")
    return Path(f"{path.resolve().name if path.exists() else path.name}{tail}.nc")


def result_target(
    model: str, output: str | None, *sources: Path | None, force: bool, tail: str = ""
) -> Path:
    """``named_after``, if a result can be written there; sources as of ``writable``."""
    target = named_after(model, output, tail)
    return writable(target, force=force, sources=sources, kinds=RESULTS)


def output_path(result: str, output: str | None, ending: str) -> Path:
    """The file made from a result: ``output``, by default RESULT with another ending."""
    return Path(output) if output is not None else Path(f"{Path(result).stem}{ending}")


def writable(
    path: Path,
    *,
    force: bool,
    sources: tuple[Path | None, ...] = (),
    kinds: tuple[str, ...] = (),
    any_name: bool = False,
) -> Path:
    """Returns the path if it can be written.

    Args:
        path: the file.
        force: True to overwrite an existing file.
        sources: input files, which are never overwritten.
        kinds: suffixes of what the command writes; files of others are never overwritten.
        any_name: a new file may have another suffix.

    Raises:
        Refused: says why, and what to do.
    """
    from dap3d_core.result import ResultError
    from dap3d_core.result.file.atomic_write import cannot, check_target

    try:
        if not force and path.is_file():
            raise Refused(f"{path} exists; --force overwrites it, -o writes another file")
        target = check_target(path, force)
    except OSError as error:
        reason = error if isinstance(error, ResultError) else cannot("write", path, error)
        raise Refused(str(reason)) from error
    is_stdout = False
    for source in sources:
        if source is not None and path.exists() and source.exists() and path.samefile(source):
            raise Refused(f"{path} is the input file; name another file with -o")
    is_named = path.suffix.lower() in kinds or (any_name and not path.exists())
    if kinds and not is_named:
        other = "; dap3d post and dap3d export make other files of it" if kinds == RESULTS else ""
        raise Refused(f"cannot write {path}: name a {' or '.join(kinds)} file with -o{other}")
    with suppress(OSError, ValueError):  # no such file, or no stream of the system
        is_stdout = os.path.samestat(target.stat(), os.fstat(sys.stdout.fileno()))
    if is_stdout:
        raise Refused(f"{path} is the standard output of this command; name another file with -o")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise Refused(
            f"cannot write {path}: no permission to write in its folder; name another with -o"
        )
    return path


def picture_checks(
    path: Path, *, force: bool, sources: tuple[Path | None, ...] = ()
) -> list[Callable[[], object]]:
    """The checks of a picture to write, for ``refuse_all``."""
    from dap3d_core.plot.figure_file import check_suffix

    return [partial(check_suffix, path), partial(writable, path, force=force, sources=sources)]


def write_text(path: Path, text: str) -> None:
    """Replace a file as a whole; a link is replaced, never followed."""
    from dap3d_core.kernels.runtime.sealed_files import replace_file

    try:
        replace_file(path, text.encode("utf-8"))
    except OSError as error:
        raise Refused(f"cannot write {path}: {error.strerror or error}") from error


def open_result(path: str, *, model: str | None = None, allow_code: bool = False) -> "Result":
    """The result in a file, with the types of a model; refused if it cannot be read."""
    import dap3d_core as dap
    from dap3d_core.result import ResultError

    with refusing(ResultError):
        return dap.open(path, model=model, allow_code=allow_code)


def open_state(
    words: str, *, allow_code: bool = False
) -> "tuple[tuple[Result, float | None], Path]":
    """A result and a time of it, None for its end, and the file: RESULT or RESULT@TIME."""
    name, mark, time = words.rpartition("@")
    if not mark or Path(words).exists():
        return (open_result(words, allow_code=allow_code), None), Path(words)
    with suppress(ValueError):
        if math.isfinite(instant := float(time)):
            return (open_result(name, allow_code=allow_code), instant), Path(name)
    raise Refused(
        f"--from {words}: {time!r} is no time in s, and there is no file {words}; write "
        "RESULT@TIME, run.nc@1.5"
    )


def open_sweep(path: str) -> "xarray.Dataset":
    """The data set of a sweep in a file; refused if it cannot be read."""
    import dap3d_core as dap
    from dap3d_core.result import ResultError

    with refusing(ResultError):
        return dap.open_sweep(path)


def refuse_all(*checks: Callable[[], object]) -> None:
    """Make all checks; refuse with one line for each fault."""
    from dap3d_core.result import ResultError, UnknownNameError

    faults: dict[str, None] = {}
    for check in checks:
        try:
            check()
        except (Refused, ResultError, UnknownNameError, ValueError) as error:
            faults[str(error)] = None
    if faults:
        raise Refused("\n".join(faults))
